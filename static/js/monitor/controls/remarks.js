// What the PT notes with one tap, and the exertion (Borg), which is asked for.

import { _, fill } from "garry/shared/language";
import { describe } from "garry/monitor/annotations";

export function createRemarks({ state, announce, onPress, remark }) {
  const exertion = document.getElementById("exertion");

  onPress("[data-remark]", ({ dataset }) => {
    if (dataset.remark === "borg") exertion.showModal();
    else remark(dataset.remark);
  });
  exertion.addEventListener("close", () => {
    if (exertion.returnValue) remark("borg", Number(exertion.returnValue));
    exertion.returnValue = "";
  });

  return {
    events: {
      remark(_session, { number, what, value }) {
        const annotation = { after: number, kind: what, value };
        state.annotations.push(annotation);
        announce(fill(_("Noted: %(what)s"), { what: describe(annotation) }));
      },
    },
  };
}
