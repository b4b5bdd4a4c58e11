// Strides of one worn sensor, sample by sample: rehab/gait/wearables/detector.py, line by line, with an accelerometer.
//
// tests/sensor/test_detector.py feeds both with the same samples: they decide alike, to less than a millisecond.

import { SagittalAxis } from "garry/sensor/axis";
import { History } from "garry/sensor/history";
import { Mounting, Standing } from "garry/sensor/mounting";
import { NOWHERE, Orientation, dot, isNowhere, scale } from "garry/sensor/orientation";
import { Reading } from "garry/sensor/readings";
import { GAP_S } from "garry/sensor/swings";

export const VERSION = 2;
const HELD_S = 60;
const STRIDES_MIN = 3;
const STRIDES_SURE = 5;
const STRIDES_ASKED = 12;
const QUIETER = 0.9;
const QUIETER_ALONE = 0.5;
const STRIDES_MOVED = 5;

export class WearableDetector {
  #place;
  #last_s = NaN;
  #lastRate = NOWHERE;
  #moved = 0;
  #orientation;
  #axis;
  #mounting;
  #history;
  #standing;
  #angle;
  #heading;
  #held;
  #readings;
  #best;
  #isCertain;
  #judged;
  #contrary;

  // `place`: "foot" or "shank".
  constructor(place) {
    this.#place = place;
    this.#begin();
  }

  get left() {
    return this.#best && scale(this.#axis.axis, this.#best.sign);
  }

  // Whether the patient has to lift the toes once, or swing the shank: no stride is returned until then.
  get isInDoubt() {
    return !this.#best && Math.max(...this.#readings.map((one) => one.total)) >= STRIDES_ASKED;
  }

  // The vertical in the sensor's frame when the leg last stood still; null before.
  get upright() {
    return this.#standing.upright;
  }

  get axisShare() {
    return this.#axis.share;
  }

  // Add a sample [s, rad/s, m/s² with gravity] and return the strides that it completes.
  add(time_s, rate, acceleration) {
    const [step_s, last] = [time_s - this.#last_s, this.#lastRate];
    [this.#last_s, this.#lastRate] = [time_s, rate];
    if (!(step_s > 0 && step_s <= GAP_S)) {
      this.#orientation.restart();
      for (const reading of this.#readings) reading.restart();
      return [];
    }
    const meanRate = [(rate[0] + last[0]) / 2, (rate[1] + last[1]) / 2, (rate[2] + last[2]) / 2];
    this.#orientation.add(step_s, acceleration, meanRate);
    this.#axis.add(step_s, acceleration, rate, this.#orientation);
    const { up, isSettled } = this.#orientation;
    this.#held.push({ time_s, step_s, rate, meanRate, acceleration, up, isSettled });
    if (!this.#axis.isKnown) {
      if (this.#held[0].time_s < time_s - HELD_S) this.#held.shift();
      return [];
    }
    for (const sample of this.#held) this.#follow(sample);
    this.#held = [];
    return this.#release();
  }

  #begin() {
    this.#orientation = new Orientation();
    this.#axis = new SagittalAxis();
    this.#mounting = new Mounting();
    this.#history = new History();
    this.#standing = new Standing();
    this.#angle = this.#heading = 0;
    this.#held = [];
    this.#readings = [1, -1].map((sign) => new Reading(sign, this.#place, this.#history));
    this.#best = null;
    this.#isCertain = false;
    this.#judged = this.#contrary = 0;
  }

  #follow({ time_s, step_s, rate, meanRate, acceleration, up, isSettled }) {
    const axis = this.#axis.axis;
    const turning = dot(rate, axis);
    this.#angle += step_s * dot(meanRate, axis);
    this.#heading += step_s * dot(meanRate, up);
    const speed = Math.sqrt(dot(rate, rate));
    this.#history.add({
      time_s,
      rate: turning,
      angle: this.#angle,
      speed,
      heading: this.#heading,
      up: isSettled ? up : NOWHERE,
    });
    const lifted = this.#standing.add(step_s, speed, acceleration, up, this.#angle);
    if (lifted !== null && this.isInDoubt) {
      this.#best = this.#readings.find((one) => one.sign === -lifted);
      this.#isCertain = true;
    }
    for (const reading of this.#readings) reading.add(time_s, turning, axis, this.#standing.upright);
  }

  #release() {
    const [first, second] = this.#readings;
    if (!this.#isCertain && first.total + second.total > this.#judged) {
      this.#judged = first.total + second.total;
      this.#judge();
    }
    if (!this.#best) return [];
    for (const reading of this.#readings) if (reading !== this.#best) reading.strides = [];
    const strides = [];
    while (this.#best?.strides.length) {
      const [stride, rest] = this.#best.strides.shift();
      const axis = this.#axis.isSure ? this.#axis.axis : NOWHERE;
      const hasMoved = !isNowhere(rest) && this.#mounting.add(rest, axis);
      if (hasMoved || this.#moved) stride.reasons.push("sensor_moved");
      strides.push(stride);
      this.#moved = hasMoved ? STRIDES_MOVED : Math.max(0, this.#moved - 1);
      if (hasMoved) this.#begin();
    }
    return strides;
  }

  #judge() {
    if (Math.max(...this.#readings.map((one) => one.count)) < STRIDES_SURE) return;
    const known = this.#readings.filter((one) => one.count >= STRIDES_MIN);
    const quiet = known.reduce((best, one) => (one.motion < best.motion ? one : best));
    const other = this.#readings.find((one) => one !== quiet);
    const ahead = this.#axis.leftSign;
    if (ahead === null ? known.length < 2 || !this.#axis.isSure : ahead !== quiet.sign) return;
    if (!quiet.isPlausible || quiet.motion > other.motion * (ahead === null ? QUIETER_ALONE : QUIETER)) return;
    if (!this.#best) {
      this.#best = quiet;
    } else if (quiet === this.#best) {
      this.#contrary = 0;
    } else {
      this.#contrary += 1;
      if (this.#contrary >= STRIDES_SURE) {
        this.#begin();
        this.#moved = STRIDES_MOVED;
      }
    }
  }
}
