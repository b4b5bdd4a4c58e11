// What a phone's sensors say, as samples [s, rad/s, m/s²], and what is wrong with it.
//
// Browsers differ in the sign of acceleration and in the unit of rotation. The detector needs no sign, as it finds up
// and ahead by the same acceleration; the unit shows in how fast a leg swings.

const SLOW_HZ = 45;
const GAP_S = 0.3;
const TROUBLE_S = 5; // how long one lasts at least, so that it can be read
const WINDOW = 120; // samples by which the rate is known
const FAST_DEG_S = 15; // no leg turns by so much in rad/s, every walking one does in °/s
const STRIKE_M_S2 = 15; // of a foot on the floor
const STRIKES = 20; // samples of such, from which one has walked

export class Motion {
  #stamps = [];
  #fastest = 0;
  #strikes = 0;
  #troubles = new Map(); // until when each lasts [s]
  #last_s = null;

  // A sample of an event of devicemotion; null for one without rotation.
  read({ rotationRate, accelerationIncludingGravity: acceleration, timeStamp }) {
    const turns = [rotationRate?.beta, rotationRate?.gamma, rotationRate?.alpha]; // about x, y, z
    const pulls = [acceleration?.x, acceleration?.y, acceleration?.z];
    if (![...turns, ...pulls].every(Number.isFinite)) return null;
    const time_s = (performance.timeOrigin + timeStamp) / 1000;
    if (this.#last_s !== null && time_s - this.#last_s > GAP_S) this.#note("gap", time_s);
    this.#last_s = time_s;
    this.#stamps.push(time_s);
    if (this.#stamps.length > WINDOW) this.#stamps.shift();
    if (this.rate_hz !== null && this.rate_hz < SLOW_HZ) this.#note("slow", time_s);
    this.#fastest = Math.max(this.#fastest, ...turns.map(Math.abs));
    if (Math.hypot(...pulls) > STRIKE_M_S2) this.#strikes += 1;
    // Chrome before 66 gave rad/s.
    const isRadians = this.#strikes > STRIKES && this.#fastest <= FAST_DEG_S;
    const factor = isRadians ? 1 : Math.PI / 180;
    return { time_s, rate: turns.map((one) => one * factor), acceleration: pulls };
  }

  get rate_hz() {
    const stamps = this.#stamps;
    if (stamps.length < WINDOW) return null;
    return (stamps.length - 1) / (stamps[stamps.length - 1] - stamps[0]);
  }

  #note(trouble, now_s) {
    this.#troubles.set(trouble, now_s + TROUBLE_S);
  }

  // The worst of what is wrong now, "" for nothing.
  trouble(now_s) {
    return ["gap", "slow"].find((one) => (this.#troubles.get(one) ?? 0) > now_s) ?? "";
  }
}
