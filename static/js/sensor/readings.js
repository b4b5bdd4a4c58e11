// The strides of a leg with one sign of its axis: rehab/gait/wearables/doubtful_strides.py, line by line.

import { scale } from "garry/sensor/orientation";
import { GAP_S, SwingDetector } from "garry/sensor/swings";

const STRIDE_MIN_S = 0.5;
const STRIDE_MAX_S = 6;
const OFFSETS_S = { foot: [0, -0.022], shank: [-0.011, -0.039] };
const TURN_RAD = (20 * Math.PI) / 180;
const SLOW_S = 1 / 45;
const LOST_S = 0.04;
const STRIDES_JUDGED = 10;
const STRIDES_HELD = 200;
const INTERRUPTED = 1.6;
const SWING_UNLIKE = 1.5;
const SWINGS_MIN = 3;
const STANCE_MIN = 0.45;
const STANCE_MAX = 0.92;

function median(numbers) {
  const sorted = [...numbers].sort((a, b) => a - b);
  const half = sorted.length / 2;
  return sorted.length % 2 ? sorted[Math.floor(half)] : (sorted[half - 1] + sorted[half]) / 2;
}

function push(list, one, most) {
  list.push(one);
  if (list.length > most) list.shift();
}

export class Reading {
  #place;
  #history;
  #swings = new SwingDetector();
  #contact_s = NaN;
  #motions = [];
  #shares = [];
  #lengths_s = [];
  #swings_s = [];
  #isContactUnclear = false;
  strides = [];
  total = 0;

  constructor(sign, place, history) {
    this.sign = sign;
    this.#place = place;
    this.#history = history;
  }

  get count() {
    return this.#motions.length;
  }

  get motion() {
    return this.#motions.length ? median(this.#motions) : Infinity;
  }

  get isPlausible() {
    if (!this.#shares.length) return false;
    const share = median(this.#shares);
    return share >= STANCE_MIN && share <= STANCE_MAX;
  }

  restart() {
    this.#swings.restart();
    this.#contact_s = NaN;
    this.#isContactUnclear = false;
  }

  add(time_s, rate, left, upright) {
    const swing = this.#swings.add(time_s, this.sign * rate);
    if (!swing) return;
    const begin_s = this.#contact_s;
    this.#contact_s = swing.end_s;
    const stride_s = swing.end_s - begin_s;
    if (begin_s < swing.begin_s && stride_s >= STRIDE_MIN_S && stride_s <= STRIDE_MAX_S) {
      this.#measure(begin_s, swing, left, upright);
    }
  }

  #measure(begin_s, swing, left, upright) {
    const [history, sign, leaves_s] = [this.#history, this.sign, swing.begin_s];
    const [initial_s, terminal_s] = OFFSETS_S[this.#place];
    const isFoot = this.#place === "foot";
    const stride_s = swing.end_s - begin_s;
    const stance_s = leaves_s + terminal_s - begin_s - initial_s;
    const stride = {
      initial_contact_s: begin_s + initial_s,
      terminal_contact_s: leaves_s + terminal_s,
      stride_s,
      stance_s,
      end_s: begin_s + initial_s + stride_s,
      reasons: this.#findDoubts(begin_s, swing),
      rate_hz: 1 / history.findMeanStep(begin_s, swing.end_s),
      foot_strike_rad: isFoot ? history.findFootStrike(begin_s, leaves_s, sign) : null,
      push_off_rad_s: isFoot ? history.findPushOff(begin_s, leaves_s, sign) : null,
      shank_lean_rad: !isFoot && upright ? history.findLean(leaves_s + terminal_s, upright, scale(left, sign)) : null,
    };
    push(this.strides, [stride, history.findRest(begin_s, leaves_s)], STRIDES_HELD);
    this.total += 1;
    push(this.#shares, stance_s / stride_s, STRIDES_JUDGED);
    push(this.#motions, history.findMotion(begin_s, leaves_s), STRIDES_JUDGED);
  }

  #findDoubts(begin_s, swing) {
    const history = this.#history;
    const doubts = [];
    if (history.findTurn(begin_s, swing.end_s) > TURN_RAD) doubts.push("turning");
    const contacts = [begin_s, swing.begin_s, swing.end_s];
    if (contacts.some((at_s) => history.findLongestStep(at_s - GAP_S, at_s + GAP_S) > LOST_S)) {
      doubts.push("samples_lost");
    }
    const length_s = swing.end_s - begin_s;
    if (this.#lengths_s.length && length_s > INTERRUPTED * median(this.#lengths_s)) doubts.push("interrupted");
    push(this.#lengths_s, length_s, STRIDES_JUDGED);
    if (history.findMeanStep(begin_s, swing.end_s) > SLOW_S) doubts.push("low_rate");
    const wasUnclear = this.#isContactUnclear;
    this.#isContactUnclear = this.#isUnlike(swing);
    if (wasUnclear || this.#isContactUnclear) doubts.push("contact_unclear");
    return doubts;
  }

  #isUnlike({ begin_s, end_s }) {
    const swing_s = end_s - begin_s;
    const usual_s = this.#swings_s.length >= SWINGS_MIN ? median(this.#swings_s) : swing_s;
    push(this.#swings_s, swing_s, STRIDES_JUDGED);
    return Math.max(swing_s / usual_s, usual_s / swing_s) > SWING_UNLIKE;
  }
}
