// The buttons beside what is shown once: copy what an element holds, print the page.

import { _ } from "garry/shared/language";

for (const button of document.querySelectorAll("[data-copy]")) {
  // Without TLS a browser has no clipboard: the text is selected, to be copied by hand.
  button.addEventListener("click", async () => {
    const held = document.querySelector(button.dataset.copy);
    getSelection().selectAllChildren(held);
    try {
      await navigator.clipboard.writeText(held.innerText);
      button.textContent = _("Copied");
    } catch {
      button.textContent = _("Selected: copy it with the keyboard");
    }
  });
}
document.querySelector("[data-print]")?.addEventListener("click", () => print());
