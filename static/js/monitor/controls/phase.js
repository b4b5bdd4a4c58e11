// The session's phases on top of the page, and the button that goes to the next one.

import { _, fill } from "garry/shared/language";
import { phaseName } from "garry/shared/labels";
import { TYPE_FIELDS } from "garry/monitor/controls/feedback_type";
import { update } from "garry/monitor/state";

const FIELDS = ["phase", "goal", "gain", "obstacle", "active_s", "phase_s", "phase_strides", ...TYPE_FIELDS];

export function createPhase({ show, onPress, change }) {
  const list = document.querySelector(".phases");
  const button = document.querySelector("[data-next-phase]");

  function drawList({ phases, phase }) {
    if (list.children.length !== phases.length) {
      const items = phases.map(({ name }) =>
        Object.assign(document.createElement("li"), { textContent: phaseName(name) }),
      );
      list.replaceChildren(...items);
    }
    [...list.children].forEach((item, index) => {
      item.className = index < phase.index ? "was" : index === phase.index ? "is" : "";
      if (index === phase.index) item.setAttribute("aria-current", "step");
      else item.removeAttribute("aria-current");
    });
  }

  onPress("[data-next-phase]", (_button, { phase }) => change("phase", phase.index + 1));

  return {
    draw(session) {
      drawList(session);
      const next = session.phases[session.phase.index + 1];
      show("next-phase", next ? fill(_("Go to %(phase)s"), { phase: phaseName(next.name) }) : _("No further phase"));
      button.disabled = !next;
    },
    events: {
      phase: (session, event) => update(session, event, FIELDS),
    },
  };
}
