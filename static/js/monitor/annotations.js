// What was changed or noted, on the PT's chart: a badge for each kind, and a legend of those that are there.

import { _, fill, number } from "garry/shared/language";
import { percent } from "garry/shared/format";
import { remarkName, severityName } from "garry/shared/labels";

// Of each kind of change its badge, label, format and labelled values (rehab/training/controls/registry.py).
const MARKS = JSON.parse(document.getElementById("chart-marks").textContent);
const FORMATS = {
  none: () => "",
  number: (value) => number(value, 2),
  percent,
  choice: (value, choices) => choices[value] ?? value,
};
const ASSISTANCE = new Set(["walking_aid", "orthosis", "handrail", "helping_hand"]);
const PLACES = { belt_speed: 2 };
const REMARK_BADGE = "▲";

export const badgeOf = ({ kind }) => MARKS[kind]?.badge ?? REMARK_BADGE;

export const isRemark = ({ kind }) => !(kind in MARKS);

// Return what a change or remark means: "gain 0.90", "near fall", "borg 4", "slightly hurt".
export function describe({ kind, value }) {
  if (kind === "fall_severity") return severityName(value);
  const mark = MARKS[kind];
  const name = mark?.label ?? remarkName(kind);
  if (value == null) return name;
  if (ASSISTANCE.has(kind)) return value ? name : fill(_("without %(help)s"), { help: name });
  const text = mark ? FORMATS[mark.format](value, mark.choices) : number(value, PLACES[kind] ?? 0);
  return text === "" ? name : `${name} ${text}`;
}

// Return [badge, text] for each kind; of changes the latest value.
export function legendOf(annotations) {
  const latest = new Map();
  for (const each of annotations) latest.set(isRemark(each) ? REMARK_BADGE : each.kind, each);
  return [...latest.values()].map((each) => [badgeOf(each), isRemark(each) ? _("noted") : describe(each)]);
}
