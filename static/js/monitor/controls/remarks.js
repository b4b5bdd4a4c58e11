// What the PT notes with one tap, and the exertion (Borg), which is asked for.

import { _, fill } from "garry/shared/language";
import { describe } from "garry/monitor/annotations";
import { openDialog } from "garry/monitor/controls/open_dialog";
import { annotationOf } from "garry/monitor/state";

export function createRemarks({ announce, onPress, remark }) {
  const exertion = document.getElementById("exertion");

  onPress("[data-remark]", ({ dataset }) => {
    if (dataset.remark === "borg") openDialog(exertion, (felt) => felt && remark("borg", Number(felt)));
    else remark(dataset.remark);
  });

  return {
    events: {
      remark: (_session, event) => announce(fill(_("Noted: %(what)s"), { what: describe(annotationOf(event)) })),
    },
  };
}
