// What was changed or noted, on the PT's chart: a badge for each kind, and a legend of those that are there.

import { _, number } from "garry/language";
import { remarkName, typeName } from "garry/names";

const percent = (share) => `${number(100 * share)} %`;
const LEVELS = { 1: _("normal"), 0.5: _("gentle"), 0: _("off") };

const STYLES = { points: _("points"), line: _("line") };

// kind: [badge, what it is, its value in words]
const KINDS = {
  goal: ["⚑", _("goal"), (value) => number(value, 2)],
  gain: ["G", _("gain"), (value) => number(value, 2)],
  activation_threshold: ["A", _("robot acts from"), percent],
  robot_intensity: ["R", _("robot"), (value) => LEVELS[value] ?? value],
  valence: ["N", _("next type"), (value) => typeName(value)],
  type: ["T", _("feedback type"), (value) => typeName(value.toLowerCase(), value)],
  feedback_text: ["E", _("words edited"), () => ""],
  words_shown: ["W", _("words"), (value) => (value ? _("on") : _("off"))],
  chart_style: ["C", _("chart"), (value) => STYLES[value] ?? value],
  pause: ["‖", _("pause"), () => ""],
  resume: ["▸", _("went on"), () => ""],
};
const REMARK = "▲";

export function badge({ kind }) {
  return KINDS[kind]?.[0] ?? REMARK;
}

export const isRemark = ({ kind }) => !(kind in KINDS);

// What a mark means: "gain 0.90", "near fall", "borg 4".
export function say({ kind, value }) {
  const [, name, write] = KINDS[kind] ?? ["", remarkName(kind), (much) => number(much)];
  const words = value === null || value === undefined ? "" : write(value);
  return words === "" ? name : `${name} ${words}`;
}

// One entry a kind: what it is, and of changes the latest value.
export function legend(marks) {
  const latest = new Map();
  for (const mark of marks) latest.set(isRemark(mark) ? REMARK : mark.kind, mark);
  return [...latest.values()].map((mark) => [badge(mark), isRemark(mark) ? _("noted") : say(mark)]);
}
