// Swings of a leg in its sagittal rate: rehab/gait/wearables/swings.py, line by line.

const SWING_RAD_S = 0.5;
const SWING_RAD = (8 * Math.PI) / 180;
const SWING_SHARE = 0.4;
const SWINGS = 10;
const SWINGS_S = 20;
const SWING_MIN_S = 0.11;
const SWING_MAX_S = 1.5;
const NOISE_RAD_S = 0.3;
const END_S = 0.11;
export const GAP_S = 0.1;

const findCrossing = (last_s, last, now_s, now) => last_s + (now_s - last_s) * (last !== now ? last / (last - now) : 1);

export class SwingDetector {
  #fastest = [];
  #last_s = NaN;
  #last = 0;
  #begin_s;
  #end_s;
  #flat_s;
  #peak;
  #turned;

  constructor() {
    this.restart();
  }

  restart() {
    this.#begin_s = this.#end_s = this.#flat_s = NaN;
    this.#peak = this.#turned = 0;
  }

  add(time_s, rate) {
    const [last_s, last] = [this.#last_s, this.#last];
    [this.#last_s, this.#last] = [time_s, rate];
    if (!(time_s - last_s > 0 && time_s - last_s <= GAP_S)) {
      this.restart();
      return null;
    }
    if (Number.isNaN(this.#begin_s)) {
      if (last >= 0 && rate < 0) {
        this.#begin_s = findCrossing(last_s, last, time_s, rate);
        this.#turn(time_s - this.#begin_s, 0, rate);
      }
      return null;
    }
    if (rate < 0) {
      this.#end_s = NaN;
      if (rate < -NOISE_RAD_S) this.#flat_s = NaN;
      this.#turn(time_s - last_s, Math.min(last, 0), rate);
    } else if (Number.isNaN(this.#end_s)) {
      this.#end_s = findCrossing(last_s, last, time_s, rate);
      this.#turn(this.#end_s - last_s, last, 0);
      if (Number.isNaN(this.#flat_s)) this.#flat_s = this.#end_s;
    }
    const [begin_s, flat_s] = [this.#begin_s, this.#flat_s];
    if (Number.isNaN(flat_s)) {
      if (time_s - begin_s > SWING_MAX_S) this.restart();
      return null;
    }
    if (rate <= NOISE_RAD_S && time_s - flat_s <= END_S) return null;
    const end_s = rate > NOISE_RAD_S ? this.#end_s : flat_s;
    const isSwing =
      end_s - begin_s >= SWING_MIN_S && this.#turned >= SWING_RAD && this.#peak > this.#findThreshold(time_s);
    if (isSwing) {
      this.#fastest.push([time_s, this.#peak]);
      if (this.#fastest.length > SWINGS) this.#fastest.shift();
    }
    this.restart();
    return isSwing ? { begin_s, end_s } : null;
  }

  #turn(step_s, before, after) {
    this.#turned -= (step_s * (before + after)) / 2;
    this.#peak = Math.max(this.#peak, -after);
  }

  #findThreshold(now_s) {
    const usual = this.#fastest.filter(([when_s]) => now_s - when_s <= SWINGS_S).map(([, peak]) => peak);
    usual.sort((a, b) => a - b);
    return usual.length ? Math.max(SWING_RAD_S, SWING_SHARE * usual[Math.floor(usual.length / 2)]) : SWING_RAD_S;
  }
}
