// What was changed or noted, on the PT's chart: a badge for each kind, and a legend of those that are there.

import { _, number } from "garry/shared/language";
import { percent } from "garry/shared/format";
import { remarkName, typeName } from "garry/shared/labels";

const LEVELS = { 1: _("normal"), 0.5: _("gentle"), 0: _("off") };
const CHART_STYLES = { points: _("points"), line: _("line") };

// kind: [badge, its name, its value as text]
const CHANGES = {
  goal: ["⚑", _("goal"), (value) => number(value, 2)],
  gain: ["G", _("gain"), (value) => number(value, 2)],
  activation_threshold: ["A", _("robot acts from"), percent],
  robot_intensity: ["R", _("robot"), (value) => LEVELS[value] ?? value],
  valence: ["N", _("next type"), (value) => typeName(value)],
  type: ["T", _("feedback type"), (value) => typeName(value.toLowerCase(), value)],
  feedback_text: ["E", _("words edited"), () => ""],
  words_shown: ["W", _("words"), (value) => (value ? _("on") : _("off"))],
  chart_style: ["C", _("chart"), (value) => CHART_STYLES[value] ?? value],
  pause: ["‖", _("pause"), () => ""],
  resume: ["▸", _("went on"), () => ""],
};
const REMARK_BADGE = "▲";

export const badgeOf = ({ kind }) => CHANGES[kind]?.[0] ?? REMARK_BADGE;

export const isRemark = ({ kind }) => !(kind in CHANGES);

// Return what a change or remark means: "gain 0.90", "near fall", "borg 4".
export function describe({ kind, value }) {
  const [, name, format] = CHANGES[kind] ?? ["", remarkName(kind), (amount) => number(amount)];
  const text = value == null ? "" : format(value);
  return text === "" ? name : `${name} ${text}`;
}

// Return [badge, text] for each kind; of changes the latest value.
export function legendOf(annotations) {
  const latest = new Map();
  for (const each of annotations) latest.set(isRemark(each) ? REMARK_BADGE : each.kind, each);
  return [...latest.values()].map((each) => [badgeOf(each), isRemark(each) ? _("noted") : describe(each)]);
}
