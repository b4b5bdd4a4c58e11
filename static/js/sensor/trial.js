// Another leg instead of this device's sensors, to try the page: a simulated one, or a recording that a person chose.

import { _ } from "garry/shared/language";

const EVERY_MS = 10;
const STARTS_S = 20; // in which a treadmill's belt comes up to speed: they pass at once
const PAUSE_S = 0.2; // before a recording begins again: no stride reaches across
const COUNT_HZ = 100;
const COUNTS = 65_536; // from which packet counters begin again

// What a leg does first, and what it does again and again: rows of s, m/s², °/s.
export async function fetchLeg(address) {
  const { stand, walk } = await (await fetch(address)).json();
  return [stand, walk].map((rows) => ({ rows, length_s: rows[rows.length - 1][0] + 1 / 60 }));
}

// The same of a file as this page saves it (recent.js); a first column in whole numbers counts samples, 100 a second.
export async function readRecording(file) {
  const bytes = file.stream();
  const text = file.name.endsWith(".gz") ? bytes.pipeThrough(new DecompressionStream("gzip")) : bytes;
  const read = await new Response(text).text().catch(() => ""); // no file of that kind
  const [, ...lines] = read.trim().split(/\r?\n/);
  const table = lines.map((line) => line.split(",").map(Number));
  if (table.length < 2 || table.some((row) => row.length !== 7 || !row.every(Number.isFinite))) {
    throw new Error(_("This file is no such recording. It needs the seven columns named below, with commas between."));
  }
  const first = table[0][0];
  const isCount = table.every(([at]) => Number.isInteger(at));
  const toSeconds = (at) => (isCount ? ((at - first + COUNTS) % COUNTS) / COUNT_HZ : at - first);
  const rows = table.map(([at, ...six]) => [
    toSeconds(at),
    ...six.slice(0, 3),
    ...six.slice(3).map((rate) => (rate * 180) / Math.PI),
  ]);
  const walk = { rows, length_s: rows[rows.length - 1][0] + PAUSE_S };
  return [walk, walk];
}

// Play both parts, the second one again and again. `take(event, isSkipped)`: of a sample that teaches how it is worn,
// but is not walked. Return { progress, stop }: how far it is, which time and seconds, and how many each time skips.
export function walkInstead([first, again], take) {
  const skipped_s = first.length_s > 2 * STARTS_S ? STARTS_S : 0;
  const begin = performance.now() - 1000 * skipped_s;
  let [part, start_s, next, time] = [first, 0, 0, 1];
  const played_s = () => (performance.now() - begin) / 1000;
  const timer = setInterval(() => {
    const now_s = played_s();
    while (start_s + part.rows[next][0] <= now_s) {
      const [at_s, ax, ay, az, gx, gy, gz] = part.rows[next];
      const event = {
        timeStamp: begin + 1000 * (start_s + at_s),
        accelerationIncludingGravity: { x: ax, y: ay, z: az },
        rotationRate: { beta: gx, gamma: gy, alpha: gz },
      };
      take(event, at_s < skipped_s);
      next += 1;
      if (next < part.rows.length) continue;
      start_s += part.length_s - skipped_s;
      [part, next, time] = [again, again.rows.findIndex(([later_s]) => later_s >= skipped_s), time + 1];
    }
  }, EVERY_MS);
  const progress = () => ({ time, at_s: Math.max(0, played_s() - start_s), length_s: part.length_s, skipped_s });
  return { progress, stop: () => clearInterval(timer) };
}
