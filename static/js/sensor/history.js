// The last seconds of a worn sensor, and a stride's figures: rehab/gait/wearables/history.py, line by line.

import { NOWHERE, cross, dot, isNowhere, mix, removePart } from "garry/sensor/orientation";

const KEEP_S = 8;
const FLAT_RAD_S = 0.6;
const FLAT_S = 0.06;
const STILL = [0.2, 0.6];
const PUSH_SHARE = 0.6;

const mean = (numbers) => numbers.reduce((sum, one) => sum + one, 0) / numbers.length;
const last = (list) => list[list.length - 1];

export class History {
  #moments = [];

  add(moment) {
    this.#moments.push(moment);
    let old = 0;
    while (this.#moments[old].time_s < moment.time_s - KEEP_S) old += 1;
    if (old > 100) this.#moments.splice(0, old); // cut now and then: it moves all others
  }

  between(begin_s, end_s) {
    const oldest_s = last(this.#moments).time_s - KEEP_S;
    return this.#moments.filter((one) => one.time_s >= Math.max(begin_s, oldest_s) && one.time_s <= end_s);
  }

  #middle(begin_s, end_s) {
    const length_s = end_s - begin_s;
    return this.between(begin_s + STILL[0] * length_s, begin_s + STILL[1] * length_s);
  }

  findMotion(begin_s, end_s) {
    const rates = this.#middle(begin_s, end_s).map((one) => Math.abs(one.rate));
    return rates.length ? mean(rates) : Infinity;
  }

  findRest(begin_s, end_s) {
    const ups = this.#middle(begin_s, end_s).map((one) => one.up);
    if (ups.some(isNowhere)) return NOWHERE;
    return ups.reduce((so_far, up, index) => mix(so_far, up, 1 / (index + 1)), NOWHERE);
  }

  findFootStrike(begin_s, end_s, sign) {
    let atContact = null;
    let flat = [];
    const isLong = () => flat.length > 0 && last(flat).time_s - flat[0].time_s >= FLAT_S;
    for (const one of this.between(begin_s - 0.05, end_s)) {
      if (one.time_s <= begin_s || atContact === null) atContact = one.angle;
      else if (one.speed < FLAT_RAD_S) flat.push(one);
      else if (isLong()) break;
      else flat = [];
    }
    return atContact !== null && isLong() ? sign * (mean(flat.map((one) => one.angle)) - atContact) : null;
  }

  findPushOff(begin_s, end_s, sign) {
    const late = this.between(end_s - PUSH_SHARE * (end_s - begin_s), end_s);
    return late.length ? Math.max(...late.map((one) => sign * one.rate)) : null;
  }

  #steps(begin_s, end_s) {
    const times = this.between(begin_s, end_s).map((one) => one.time_s);
    return times.slice(1).map((time_s, index) => time_s - times[index]);
  }

  findLongestStep(begin_s, end_s) {
    const steps = this.#steps(begin_s, end_s);
    return steps.length ? Math.max(...steps) : Infinity;
  }

  findMeanStep(begin_s, end_s) {
    const times = this.between(begin_s, end_s).map((one) => one.time_s);
    return times.length > 1 ? (last(times) - times[0]) / (times.length - 1) : Infinity;
  }

  findTurn(begin_s, end_s) {
    const inside = this.between(begin_s, end_s);
    return inside.length ? Math.abs(last(inside).heading - inside[0].heading) : 0;
  }

  findLean(time_s, upright, left) {
    const one = last(this.between(time_s - 0.1, time_s));
    if (!one || isNowhere(one.up)) return null;
    const [now, then] = [removePart(one.up, left), removePart(upright, left)];
    return Math.atan2(dot(left, cross(now, then)), dot(now, then));
  }
}
