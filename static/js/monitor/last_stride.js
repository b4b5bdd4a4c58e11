// The last stride in figures: performance, value, verdict, and what else was measured.

import { _, fill, number } from "garry/shared/language";
import { notReaching, percent, signed } from "garry/shared/format";
import { clockCures, phaseName, reasonName } from "garry/shared/labels";

// By which sensor a stride was measured (rehab/training/measures.py).
const WORN = {
  wearable_foot: _("foot sensor, version %(version)s"),
  wearable_shank: _("shin sensor, version %(version)s"),
};

// What a name ends with, and how it is read: "stance_s" as "stance 0.62 s".
const UNITS = {
  deg_s: "°/s",
  m_s: "m/s",
  percent: "%",
  deg: "°",
  mm_min: "mm·min",
  min: "/min",
  hz: "Hz",
  ms: "ms",
  s: "s",
};
const NAMED = new RegExp(`^(.+?)_(${Object.keys(UNITS).join("|")})$`);

export function createLastStride({ state, show }) {
  const better = document.getElementById("monitor")?.dataset.better ?? "";
  const dot = document.querySelector(".verdict .dot");

  function describeGoal({ goal, unit, obstacle, baseline }) {
    if (baseline && baseline.count < baseline.needed) obstacle = ""; // its count is told beside it (goal_coach.js)
    if (goal !== null) return fill(_("goal %(goal)s"), { goal: `${number(goal, 2)} ${unit}` });
    return obstacle || _("The goal follows from the baseline.");
  }

  // What the patient sees is gain × value, and the goal is compared with that.
  function describeValue({ value, gain }, unit) {
    if (value == null) return "";
    const scaled = gain && gain !== 1 ? ` × ${number(gain, 2)} = ${number(gain * value, 2)}` : "";
    return `${number(value, 2)}${scaled} ${unit}`;
  }

  function describeVerdict(stride, { phase, goal }) {
    if (stride.performance != null) {
      if (stride.close) return fill(_("close: %(side)s"), { side: stride.hit ? _("hit") : _("below") });
      return (stride.hit ? _("hit") : _("below")) + (stride.points ? `, ${signed(stride.points)}` : "");
    }
    if (stride.valid && goal !== null) return _("before the goal was set");
    if (stride.valid) return fill(_("%(phase)s: no goal yet"), { phase: phaseName(phase.name) });
    const why = (stride.reasons ?? []).map(reasonName).join(", ") || _("no value");
    return fill(_("does not count: %(why)s"), { why });
  }

  function describeExtra([name, value]) {
    if (name in WORN) return fill(WORN[name], { version: value });
    if (name === "heart_rate") return fill(_("heart rate %(rate)s/min"), { rate: number(value, 0) });
    const [, what, unit] = NAMED.exec(name) ?? [name, name];
    return `${what.replaceAll("_", " ")} ${number(+value.toPrecision(3), null)} ${UNITS[unit] ?? ""}`;
  }

  return {
    draw(session) {
      show("goal-line", describeGoal(session));
      const stride = state.lastStride;
      dot.hidden = stride?.performance == null;
      if (!stride) {
        for (const slot of ["number", "value", "verdict"]) show(slot, "");
        show("extras", better); // which way is better, and why
        show("performance", "–");
        return;
      }
      const isJudged = stride.performance != null;
      show("number", fill(_("no. %(number)s"), { number: stride.number }));
      show("performance", isJudged ? percent(notReaching(stride.performance)) : "—");
      show("value", describeValue(stride, session.unit));
      show(
        "extras",
        [
          ...clockCures([...(stride.reasons ?? []), ...Object.keys(stride.extra ?? {})]),
          ...Object.entries(stride.extra ?? {})
            .filter(([, value]) => value !== stride.value) // told already
            .map(describeExtra),
        ].join("\n"),
      );
      show("verdict", describeVerdict(stride, session));
      dot.classList.toggle("miss", !stride.hit && !stride.close);
      dot.classList.toggle("close", Boolean(stride.close));
    },
  };
}
