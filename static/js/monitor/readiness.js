// Before the start: whether a screen shows this patient, and whether sensor and robot are there.

import { _, fill } from "garry/shared/language";

export function createReadiness(robot) {
  const list = document.querySelector(".readiness");
  const cure = document.querySelector("[data-cure-screen]"); // what opens the patient's page

  // Return [sign, text, cure] of each: ✓ ready, ! needs a look, – not there, which may be meant so.
  function checkAll({ presence, about: { nickname: name } }) {
    return [
      presence.tablets
        ? ["✓", fill(_("A screen shows %(name)s"), { name })]
        : ["!", fill(_("No screen shows %(name)s"), { name }), cure],
      presence.source ? ["✓", _("Sensor")] : ["!", _("No sensor: switch it on")],
      robot.readiness,
      ["·", list.dataset.better], // what is trained
    ];
  }

  return {
    draw(session) {
      list.hidden = session.state !== "ready";
      if (list.hidden) return;
      const checks = checkAll(session);
      const written = checks.map(([sign, text]) => sign + text).join();
      if (list.dataset.of === written) return;
      list.dataset.of = written;
      const items = checks.map(([sign, text, cure]) => {
        const item = document.createElement("li");
        item.className = "row wrap";
        item.classList.toggle("low", sign === "!");
        item.classList.toggle("calm", sign === "·");
        item.textContent = `${sign} ${text}`;
        if (cure) item.append(cure.content.cloneNode(true));
        return item;
      });
      list.replaceChildren(...items);
    },
  };
}
