// Before the start: whether a screen shows this patient, and whether sensor and robot are there.

import { _, fill } from "garry/shared/language";

// A link that opens a page in a window beside this one (shared/own_window.js).
function openBeside(href, text) {
  const link = Object.assign(document.createElement("a"), { href, target: "_blank", textContent: text });
  link.dataset.window = "1280 800";
  return link;
}

export function createReadiness(robot) {
  const list = document.querySelector(".readiness");
  const page = document.getElementById("monitor").dataset.page; // the patient's

  // Return [sign, text, what cures it] of each: ✓ ready, ! needs a look, – not there, which may be meant so.
  function checkAll({ presence, about: { nickname: name } }) {
    return [
      presence.tablets
        ? ["✓", fill(_("A screen shows %(name)s"), { name })]
        : ["!", fill(_("No screen shows %(name)s: open the patient’s page"), { name }), page],
      presence.source ? ["✓", _("Sensor")] : ["!", _("No sensor: switch it on")],
      robot.readiness,
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
        item.className = "badge";
        item.classList.toggle("warn", sign === "!");
        item.classList.toggle("free", sign === "–");
        item.append(cure ? openBeside(cure, `${sign} ${text}`) : `${sign} ${text}`);
        return item;
      });
      list.replaceChildren(...items);
    },
  };
}
