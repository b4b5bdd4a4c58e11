// A simulated leg instead of this device's sensors, to try the page: stands, then walks for as long as it is open.

const EVERY_MS = 10;

export async function walkInstead(address, take) {
  const { stand, walk } = await (await fetch(address)).json(); // rows of a second and stride: s, m/s², °/s
  const begin = performance.now();
  const length_s = (rows) => rows[rows.length - 1][0] + 1 / 60;
  const [first_s, stride_s] = [length_s(stand), length_s(walk)];
  let [rows, start_s, next] = [stand, 0, 0];
  setInterval(() => {
    const now_s = (performance.now() - begin) / 1000;
    while (start_s + rows[next][0] <= now_s) {
      const [at_s, ax, ay, az, gx, gy, gz] = rows[next];
      take({
        timeStamp: begin + 1000 * (start_s + at_s),
        accelerationIncludingGravity: { x: ax, y: ay, z: az },
        rotationRate: { beta: gx, gamma: gy, alpha: gz },
      });
      next += 1;
      if (next < rows.length) continue;
      start_s += rows === stand ? first_s : stride_s;
      [rows, next] = [walk, 0];
    }
  }, EVERY_MS);
}
