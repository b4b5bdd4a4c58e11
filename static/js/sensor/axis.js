// The axis about which a leg swings, and its left end: rehab/gait/wearables/axis.py, line by line.

import { NOWHERE, cross, dot, isNowhere, mix, removePart, scale, toUnit } from "garry/sensor/orientation";

export const GRAVITY_M_S2 = 9.81;
const FORGET_S = 30;
const MOVING_RAD_S = 1;
const MOVED_S = 2;
const SHARE_MIN = 0.6;
const SHARE_SURE = 0.9;
const TRAVEL_FORGET_S = 10;
const SPEED_S = 1.5;
const DRIFT_S = 3;
const SPEED_MAX_M_S = 1;
const QUIET_RAD_S = 0.7;
const QUIET_M_S2 = 1.5;
const TRAVEL_M_S = 0.1;
const TRAVEL_COSINE = 0.3;

const face = (vector, towards) => (dot(vector, towards) >= 0 ? vector : scale(vector, -1));
const addScaled = (a, keep, b, weight) => [
  keep * a[0] + weight * b[0],
  keep * a[1] + weight * b[1],
  keep * a[2] + weight * b[2],
];

export class SagittalAxis {
  #spread = { xx: 0, xy: 0, xz: 0, yy: 0, yz: 0, zz: 0 };
  #moved_s = 0;
  #component = NOWHERE;
  #velocity = NOWHERE;
  #drift = NOWHERE;
  #travels = 0;
  #forward = NOWHERE;
  #up = NOWHERE;
  #quiet_s = 0;
  axis = NOWHERE;

  get isKnown() {
    return this.#moved_s >= MOVED_S;
  }

  // How much of all horizontal rotation is about one axis: low where a sensor sits crooked.
  get share() {
    const { xx, yy, zz } = this.#spread;
    const total = xx + yy + zz;
    return total ? dot(this.#component, this.#times(this.#component)) / total : 0;
  }

  // Whether the rotation alone shows the axis.
  get isSure() {
    return this.share >= SHARE_SURE;
  }

  get leftSign() {
    if (!this.#quiet_s) return null;
    const speed = Math.sqrt(dot(this.#forward, this.#forward)) / this.#quiet_s;
    const cosine = dot(this.#left, this.axis);
    if (speed < TRAVEL_M_S || Math.abs(cosine) < TRAVEL_COSINE) return null;
    return Math.sign(cosine);
  }

  get #left() {
    return toUnit(cross(this.#up, this.#forward));
  }

  add(step_s, acceleration, rate, orientation) {
    const speed = dot(rate, rate);
    if (speed > MOVING_RAD_S ** 2) this.#addRotation(step_s, removePart(rate, orientation.up));
    this.#addTravel(step_s, acceleration, speed, orientation);
    const component = face(this.#component, this.axis);
    const left = face(this.#left, this.axis);
    const trust = (this.share - SHARE_MIN) / (SHARE_SURE - SHARE_MIN);
    this.axis = isNowhere(left) || trust >= 1 ? component : toUnit(mix(left, component, Math.max(trust, 0)));
  }

  #addRotation(step_s, rate) {
    this.#moved_s += step_s;
    const keep = 1 - step_s / FORGET_S;
    const [x, y, z] = rate;
    const s = this.#spread;
    s.xx = keep * s.xx + x * x * step_s;
    s.xy = keep * s.xy + x * y * step_s;
    s.xz = keep * s.xz + x * z * step_s;
    s.yy = keep * s.yy + y * y * step_s;
    s.yz = keep * s.yz + y * z * step_s;
    s.zz = keep * s.zz + z * z * step_s;
    this.#component = toUnit(isNowhere(this.#component) ? rate : this.#times(this.#component));
  }

  #addTravel(step_s, acceleration, speed, orientation) {
    if (!orientation.isSettled) {
      this.#velocity = NOWHERE;
      this.#travels = 0;
      return;
    }
    const kept = 1 - step_s / SPEED_S;
    const linear = orientation.linear;
    this.#velocity = this.#velocity.map((one, n) => kept * (one + linear[n] * step_s));
    this.#travels += 1;
    this.#drift = mix(this.#drift, this.#velocity, Math.max(1 / this.#travels, step_s / (DRIFT_S + step_s)));
    const shaken = Math.sqrt(dot(acceleration, acceleration)) - GRAVITY_M_S2;
    const quiet_s = step_s * Math.exp(-speed / QUIET_RAD_S ** 2 - (shaken / QUIET_M_S2) ** 2);
    let behind = removePart(orientation.toSensor(this.#velocity.map((one, n) => one - this.#drift[n])), orientation.up);
    if (dot(behind, behind) > SPEED_MAX_M_S ** 2) behind = toUnit(behind);
    const keep = 1 - step_s / TRAVEL_FORGET_S;
    this.#quiet_s = keep * this.#quiet_s + quiet_s;
    this.#forward = addScaled(this.#forward, keep, behind, -quiet_s);
    this.#up = addScaled(this.#up, keep, orientation.up, quiet_s);
  }

  #times([x, y, z]) {
    const s = this.#spread;
    return [s.xx * x + s.xy * y + s.xz * z, s.xy * x + s.yy * y + s.yz * z, s.xz * x + s.yz * y + s.zz * z];
  }
}
