// Whether a sensor still sits as it did, and a leg that stands still: rehab/gait/wearables/mounting.py, standing.py.

import { GRAVITY_M_S2 } from "garry/sensor/axis";
import { NOWHERE, dot, findAngle, mix } from "garry/sensor/orientation";

const LEARNED = 10;
const LATEST = 1 / 3;
const TILT_RAD = (12 * Math.PI) / 180;
const AXIS_RAD = (20 * Math.PI) / 180;

const STILL_RAD_S = 0.15;
const STILL_M_S2 = 0.4;
const STILL_S = 1;
const LIFT_RAD = [(10 * Math.PI) / 180, (70 * Math.PI) / 180];
const BACK_RAD = (5 * Math.PI) / 180;
const LIFT_S = 3;

export class Mounting {
  #strides = 0;
  #usual = NOWHERE;
  #usualAxis = NOWHERE;
  #latest = NOWHERE;

  add(up, axis) {
    this.#strides += 1;
    if (this.#strides === 1) this.#latest = up;
    this.#latest = mix(this.#latest, up, LATEST);
    if (this.#strides <= LEARNED) {
      this.#usual = mix(this.#usual, up, 1 / this.#strides);
      this.#usualAxis = axis;
      return false;
    }
    const turned = findAngle(axis, this.#usualAxis);
    return findAngle(this.#latest, this.#usual) > TILT_RAD || (turned > AXIS_RAD && turned < Math.PI - AXIS_RAD);
  }
}

export class Standing {
  upright = null;
  #still_s = 0;
  #mean = NOWHERE;
  #samples = 0;
  #rest = null;
  #least = 0;
  #most = 0;
  #moved_s = 0;

  get isStill() {
    return this.#still_s >= STILL_S;
  }

  add(step_s, speed, acceleration, up, angle) {
    const shaken = Math.abs(Math.sqrt(dot(acceleration, acceleration)) - GRAVITY_M_S2);
    if (speed > STILL_RAD_S || shaken > STILL_M_S2) {
      this.#still_s = this.#samples = 0;
      this.#moved_s += step_s;
      if (this.#rest !== null) {
        this.#least = Math.min(this.#least, angle - this.#rest);
        this.#most = Math.max(this.#most, angle - this.#rest);
      }
      return null;
    }
    this.#still_s += step_s;
    this.#samples += 1;
    this.#mean = mix(this.#mean, up, 1 / this.#samples);
    if (this.#still_s < STILL_S) return null;
    this.upright = this.#mean;
    const answer = this.#judge();
    [this.#rest, this.#least, this.#most, this.#moved_s] = [angle, 0, 0, 0];
    return answer;
  }

  #judge() {
    const [up, down] = [this.#most, -this.#least];
    if (this.#rest === null || this.#moved_s > LIFT_S || Math.min(up, down) > BACK_RAD) return null;
    const largest = Math.max(up, down);
    if (largest < LIFT_RAD[0] || largest > LIFT_RAD[1]) return null;
    return up > down ? 1 : -1;
  }
}
