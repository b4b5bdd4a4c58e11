// Start, pause, go on (until it may, the panels are held), end (which is asked twice), and the clock.

import { _, fill } from "garry/shared/language";
import { clock } from "garry/shared/format";
import { icon } from "garry/shared/svg";
import { whyHeld } from "garry/monitor/alarm_causes";
import { openDialog } from "garry/monitor/controls/open_dialog";

// The one main button, by the session's state: the change it asks for, its label and icon.
const MAIN = {
  ready: ["start", _("Start"), "play"],
  running: ["pause", _("Pause"), "pause"],
  paused: ["resume", _("Resume"), "play"],
};

export function createRunState({ state, show, onPress, change }) {
  const main = document.querySelector("[data-main]");
  const end = document.querySelector("[data-end]");
  const panels = document.querySelectorAll(".panels > :not(.remarks)"); // what happened may be noted at any time
  const confirmEnd = document.getElementById("sure");

  onPress("[data-main]", ({ value }) => change(value));
  onPress("[data-end]", () =>
    openDialog(confirmEnd, (answer) => {
      if (answer === "end") change(state.session.state === "ready" ? "abort" : "finish");
    }),
  );

  function drawTime({ active_s: active, target, completed }) {
    const planned = target.duration_s;
    const isOver = Boolean(completed || (planned && active >= planned));
    show("clock", clock(active));
    if (isOver) show("planned", _("planned time reached"));
    else show("planned", planned ? fill(_("of %(time)s"), { time: clock(planned) }) : _("walked"));
    document.querySelector(".end").classList.toggle("over", isOver);
  }

  function drawButtons(session) {
    const [kind, label, iconId] = MAIN[session.state] ?? [""];
    const held = ["start", "resume"].includes(kind) ? whyHeld(session) : "";
    for (const panel of panels) panel.inert = Boolean(held);
    end.disabled = !kind;
    main.disabled = Boolean(!kind || held);
    const drawn = `${kind} ${held}`;
    if (main.dataset.of === drawn) return;
    main.dataset.of = drawn;
    main.value = kind;
    main.innerHTML = kind ? `${icon(iconId)}<span>${label}</span>` : _("Ended");
    if (held) main.lastChild.append(Object.assign(document.createElement("small"), { textContent: held }));
  }

  return {
    draw(session) {
      drawTime(session);
      drawButtons(session);
    },
  };
}
