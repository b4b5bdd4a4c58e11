// Fall: the robot stops and the session pauses at once, and it is noted. How badly somebody is hurt is asked when
// somebody takes care of it, here where it was tapped.

import { _, fill } from "garry/shared/language";
import { TAKEN_BACK_WITHIN_S, hasFallen } from "garry/monitor/alarm_causes";
import { openDialog } from "garry/monitor/controls/open_dialog";

export function createFall({ state: told, announce, onPress, change, note, remark, orderStop }) {
  const button = document.querySelector("[data-fall]");
  const dialog = document.getElementById("fall");

  function ask() {
    openDialog(dialog, (answer) => answer && remark("fall_severity", Number(answer)));
  }

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
    ask,
    draw(session) {
      button.disabled = !["ready", "running", "paused"].includes(session.state);
    },
    events: {
      remark(_session, { what }) {
        if (told.fellHereAt === null || !["fall_acknowledged", "fall_withdrawn"].includes(what)) return;
        told.fellHereAt = null;
        if (what === "fall_acknowledged") ask();
      },
    },
  };
}
