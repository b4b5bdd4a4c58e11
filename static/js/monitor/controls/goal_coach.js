// One line about the goal, with one tap: the goal that the latest strides suggest, or what the baseline says so far;
// and whether the goal follows by itself.

import { percent } from "garry/shared/format";
import { _, fill, number } from "garry/shared/language";
import { update } from "garry/monitor/state";

const WORTH_A_CHANGE = 0.02; // of the scale below the goal: less is within what strides vary by
const FIELDS = ["suggested_goal", "wanted_hit_rate", "is_strained", "baseline"];

export function createGoalCoach({ show, onPress, change }) {
  const line = document.querySelector(".coach");
  const [button, keep] = line.querySelectorAll("button");
  let declined = ""; // a suggestion that the therapist does not want, to that goal
  const mode = document.querySelector("[data-adaptation]");

  mode.addEventListener("change", () => change("goal_adaptation", mode.value));
  onPress("[data-coach]", (_button, session) => change("goal", session.suggested_goal));
  onPress("[data-keep]", (_button, session) => {
    declined = `${session.goal} ${session.suggested_goal}`;
    line.hidden = true;
  });

  function describeBaseline({ baseline: { mean, sd, count, needed, goal, asks }, unit }) {
    if (mean === null) return "";
    const values = { mean: number(mean, 2), sd: sd === null ? "–" : number(sd, 2), unit, count, needed };
    const told = fill(_("Baseline: mean %(mean)s %(unit)s, SD %(sd)s, %(count)s strides."), values);
    if (goal === null) return told;
    if (count < needed) return `${told} ${fill(_("The goal needs at least %(needed)s."), values)}`;
    const text = asks
      ? _("The goal would be %(goal)s %(unit)s: go to the next phase to accept it.")
      : _("Goal at the end of the baseline, as it stands: %(goal)s %(unit)s.");
    return `${told} ${fill(text, { goal: number(goal, 2), unit })}`;
  }

  function describeSuggestion({
    suggested_goal: goal,
    wanted_hit_rate: wanted,
    is_strained: strained,
    unit,
    goal: now,
    span,
  }) {
    if (goal === null) declined = "";
    if (goal === null && strained) return _("The heart rate is near its limit: no harder goal is suggested.");
    if (goal === null || now === null || declined === `${now} ${goal}`) return "";
    if (Math.abs(goal / now - 1) < WORTH_A_CHANGE * span) return "";
    const text =
      goal < now
        ? _("Lower the goal from %(now)s to %(goal)s %(unit)s? Then about %(hits)s of steps reach it.")
        : _("Raise the goal from %(now)s to %(goal)s %(unit)s? Then about %(hits)s of steps reach it.");
    return fill(text, { now: number(now, 2), goal: number(goal, 2), unit, hits: percent(wanted) });
  }

  return {
    draw(session) {
      if (document.activeElement !== mode) mode.value = session.goal_adaptation;
      const isBaseline = session.baseline && session.phase.kind === "baseline";
      const text = isBaseline ? describeBaseline(session) : "";
      const suggestion = session.goal_adaptation === "suggest" ? describeSuggestion(session) : "";
      line.hidden = !(text || suggestion);
      show("coach", text || suggestion);
      button.hidden = !suggestion || Boolean(text) || session.suggested_goal === null;
      keep.hidden = button.hidden;
      if (button.hidden) return;
      button.textContent = fill(_("Set %(goal)s"), { goal: number(session.suggested_goal, 2) });
      keep.textContent = fill(_("Keep %(goal)s"), { goal: number(session.goal, 2) });
    },
    events: {
      step: (session, event) => update(session, event, FIELDS),
      goal_adaptation(session, event) {
        session.goal_adaptation = event.value;
      },
    },
  };
}
