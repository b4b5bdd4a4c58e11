// What a stride's value is multiplied with before the patient sees it.

import { number } from "garry/shared/language";
import { markPressed } from "garry/monitor/controls/button_group";

const OFFERED = [0.85, 0.9, 0.95, 1];

export function createGain({ onPress, change }) {
  const group = document.querySelector("[data-gains]");

  function offer(gains) {
    if (group.dataset.of === gains.join()) return;
    group.dataset.of = gains.join();
    const buttons = gains.map((gain) =>
      Object.assign(document.createElement("button"), { textContent: number(gain, 2), value: gain }),
    );
    group.replaceChildren(...buttons);
  }

  onPress("[data-gains] button", ({ value }) => change("gain", Number(value)));

  return {
    draw({ gain }) {
      offer([...new Set([...OFFERED, gain])].sort((a, b) => a - b));
      markPressed(group, gain);
    },
  };
}
