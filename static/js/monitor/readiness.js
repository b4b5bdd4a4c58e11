// Before the start: whether the tablet shows this patient, and whether sensor and robot are there.

import { _, fill } from "garry/shared/language";

export function createReadiness(robot) {
  const list = document.querySelector(".readiness");

  // Return [sign, text] of each: ✓ ready, ! needs a look, – not there, which may be meant so.
  function checkAll({ presence, about: { nickname: name } }) {
    return [
      presence.tablets
        ? ["✓", fill(_("Tablet shows %(name)s"), { name })]
        : ["!", fill(_("No tablet shows %(name)s: pair one, or open the patient’s page"), { name })],
      presence.source ? ["✓", _("Sensor")] : ["!", _("No sensor: switch it on")],
      robot.readiness,
    ];
  }

  return {
    draw(session) {
      list.hidden = session.state !== "ready";
      if (list.hidden) return;
      const checks = checkAll(session);
      const written = checks.join();
      if (list.dataset.of === written) return;
      list.dataset.of = written;
      const items = checks.map(([sign, text]) => {
        const item = document.createElement("li");
        item.className = "row wrap";
        item.classList.toggle("low", sign === "!");
        item.textContent = `${sign} ${text}`;
        return item;
      });
      list.replaceChildren(...items);
    },
  };
}
