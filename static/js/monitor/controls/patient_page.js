// What the patient's page shows: with or without words, and its chart as points or as a line.

import { _ } from "garry/shared/language";
import { markPressed } from "garry/monitor/controls/button_group";

export function createPatientPage({ announce, onPress, change }) {
  const words = document.querySelector("[data-words]");
  const chart = document.querySelector(".controls [data-chart]");

  onPress("[data-words] button", ({ value }) => change("words_shown", Number(value)));
  onPress("[data-chart] button", ({ value }) => change("chart_style", value));

  return {
    draw(session) {
      markPressed(words, session.words_shown ? 1 : 0);
      markPressed(chart, session.chart);
    },
    events: {
      words_shown(session, event) {
        session.words_shown = event.value;
      },
      chart_style(session, event) {
        session.chart = event.value;
      },
      feedback_text() {
        announce(_("The words were edited; the patient reads them from the next step."));
      },
    },
  };
}
