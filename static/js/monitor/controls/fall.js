// Fall: the robot stops and the session pauses at once, and it is noted. How badly somebody is hurt is asked once
// somebody takes care of it.

import { _, fill } from "garry/shared/language";
import { TAKEN_BACK_WITHIN_S, hasFallen } from "garry/monitor/alarm_causes";
import { markPressed } from "garry/monitor/controls/button_group";

export function createFall({ state: told, announce, onPress, change, note, remark, orderStop }) {
  const button = document.querySelector("[data-fall]");

  onPress("[data-severity] button", ({ value }) => remark("fall_severity", Number(value)));
  onPress("[data-fall]", async (_button, session) => {
    orderStop();
    if (session.state === "running") change("pause");
    announce(_("The robot is told to stop, and the session to pause."));
    if (told.sinceFell_s < TAKEN_BACK_WITHIN_S || hasFallen(session)) return; // tapped twice: one fall
    told.fellHereAt = performance.now();
    try {
      await note("fall");
      announce(""); // the alarm says so
    } catch (problem) {
      told.fellHereAt = null;
      announce(fill(_("The fall is not noted: %(problem)s"), { problem: problem.message }));
    }
  });

  return {
    draw(session) {
      button.disabled = !["ready", "running", "paused"].includes(session.state);
      const asked = document.querySelector("[data-severity]");
      if (asked) markPressed(asked, session.fall_seen?.severity);
    },
    events: {
      remark(session, { what, value }) {
        if (["fall_acknowledged", "fall_withdrawn"].includes(what)) told.fellHereAt = null;
        if (what === "fall_severity" && session.fall_seen) session.fall_seen.severity = value;
      },
    },
  };
}
