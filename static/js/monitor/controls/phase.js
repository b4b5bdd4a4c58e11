// The phases, and the buttons that go to the next one and begin this one anew.

import { _, fill } from "garry/shared/language";
import { phaseName } from "garry/shared/labels";
import { createPhaseBar } from "garry/monitor/phase_bar";

export function createPhase({ show, onPress, change }) {
  const drawBar = createPhaseBar(document.querySelector(".phases"));
  const button = document.querySelector("[data-next-phase]");

  onPress("[data-next-phase]", (_button, { phase }) => change("phase", phase.index + 1));

  // What a phase has counted stays; its strides and seconds begin anew.
  const again = document.querySelector("[data-repeat-phase]");
  onPress("[data-repeat-phase]", (_button, { phase }) => change("phase", phase.index));

  return {
    draw(session) {
      again.disabled = !["running", "paused"].includes(session.state);
      drawBar(session);
      const next = session.phases[session.phase.index + 1];
      show("next-phase", next ? fill(_("Go to %(phase)s"), { phase: phaseName(next.name) }) : "");
      button.disabled = button.hidden = !next;
    },
  };
}
