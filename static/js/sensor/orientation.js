// Which way is up for a worn sensor: rehab/gait/wearables/orientation.py, line by line. Vectors are arrays of three.

const LEVEL_S = 1.5;
const SETTLED_S = 2 * LEVEL_S;

export const NOWHERE = [0, 0, 0];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const isNowhere = (a) => a[0] === 0 && a[1] === 0 && a[2] === 0;
export const scale = (a, factor) => [factor * a[0], factor * a[1], factor * a[2]];
export const mix = (a, b, weight) => [
  a[0] + weight * (b[0] - a[0]),
  a[1] + weight * (b[1] - a[1]),
  a[2] + weight * (b[2] - a[2]),
];

export function toUnit(a) {
  const length = Math.sqrt(dot(a, a));
  return length ? [a[0] / length, a[1] / length, a[2] / length] : a;
}

export function removePart(a, along) {
  const part = dot(a, along);
  return [a[0] - part * along[0], a[1] - part * along[1], a[2] - part * along[2]];
}

export function findAngle(a, b) {
  const across = cross(a, b);
  return Math.atan2(Math.sqrt(dot(across, across)), dot(a, b));
}

function rotate([w, x, y, z], [a, b, c]) {
  const e = 2 * (y * c - z * b);
  const f = 2 * (z * a - x * c);
  const g = 2 * (x * b - y * a);
  return [a + w * e + y * g - z * f, b + w * f + z * e - x * g, c + w * g + x * f - y * e];
}

export class Orientation {
  #q = [1, 0, 0, 0];
  #first;
  #second;
  #samples;
  #age_s;

  constructor() {
    this.restart();
  }

  restart() {
    this.#first = this.#second = NOWHERE;
    this.#samples = this.#age_s = 0;
    this.up = NOWHERE;
    this.linear = NOWHERE;
  }

  get isSettled() {
    return this.#age_s >= SETTLED_S;
  }

  add(step_s, acceleration, rate) {
    this.#turn(step_s, rate);
    const level = rotate(this.#q, acceleration);
    this.#samples += 1;
    this.#age_s += step_s;
    const weight = Math.max(1 / this.#samples, step_s / (LEVEL_S + step_s));
    this.#first = mix(this.#first, level, weight);
    const up = (this.#second = mix(this.#second, this.#first, weight));
    this.linear = [level[0] - up[0], level[1] - up[1], level[2] - up[2]];
    this.up = toUnit(this.toSensor(up));
  }

  toSensor(vector) {
    const [w, x, y, z] = this.#q;
    return rotate([w, -x, -y, -z], vector);
  }

  #turn(step_s, rate) {
    const speed = Math.sqrt(dot(rate, rate));
    if (!(speed * step_s)) return;
    const share = Math.sin((speed * step_s) / 2) / speed;
    const [a, b, c, d] = this.#q;
    const [e, f, g, h] = [Math.cos((speed * step_s) / 2), rate[0] * share, rate[1] * share, rate[2] * share];
    const w = a * e - b * f - c * g - d * h;
    const x = a * f + b * e + c * h - d * g;
    const y = a * g - b * h + c * e + d * f;
    const z = a * h + b * g - c * f + d * e;
    const length = Math.sqrt(w * w + x * x + y * y + z * z);
    this.#q = [w / length, x / length, y / length, z / length];
  }
}
