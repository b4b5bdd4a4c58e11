// What the PT notes with one tap; exertion and pain are asked for.

import { _, fill } from "garry/shared/language";
import { describe } from "garry/monitor/annotations";
import { openDialog } from "garry/monitor/controls/open_dialog";
import { annotationOf } from "garry/monitor/state";

export function createRemarks({ announce, onPress, remark }) {
  const rating = document.getElementById("rating");
  const questions = [...rating.querySelectorAll("[data-rating]")];

  onPress("[data-remark]", ({ dataset: { remark: what } }) => {
    if (questions.every(({ dataset }) => dataset.rating !== what)) {
      remark(what);
      return;
    }
    for (const each of questions) each.hidden = each.dataset.rating !== what;
    openDialog(rating, (felt) => felt && remark(what, Number(felt)));
  });

  return {
    events: {
      remark(_session, event) {
        if (["fall", "fall_acknowledged"].includes(event.what)) return; // a banner says so
        announce(fill(_("Noted: %(what)s"), { what: describe(annotationOf(event)) }));
      },
    },
  };
}
