// Nobody leaves a patient's page by accident: going back, leaving the full screen or the way out ask
// first, for the station's PIN where it has one. The dialog is not modal, so that Pause and End stay.

import { _ } from "garry/shared/language";

const PATIENCE_MS = 30_000; // a question that nobody answers goes away

export function guardLeaving(dialog) {
  const form = dialog.querySelector("form");
  const wrong = dialog.querySelector(".wrong");
  const pin = form.elements.pin;
  let timer, left, before;

  // An entry of the history to go back to; browsers pass over those that were made before a touch.
  const trap = () => history.pushState({ stays: true }, "");

  function ask() {
    if (left) return;
    if (!dialog.open) {
      before = document.activeElement;
      form.reset();
      wrong.textContent = "";
      dialog.show();
    }
    (pin ?? dialog.querySelector("[data-stay]")).focus();
    wait();
  }

  function stay() {
    clearTimeout(timer);
    dialog.close();
    if (before?.checkVisibility()) before.focus();
  }

  function wait() {
    clearTimeout(timer);
    timer = setTimeout(stay, PATIENCE_MS);
  }

  async function answer(event) {
    event.preventDefault();
    const unpairs = event.submitter?.name === "unpair";
    const { go } = dialog.dataset;
    if (!pin && !unpairs && go) return leave(go);
    const given = new FormData(form, event.submitter);
    try {
      const response = await fetch(form.action, { method: "POST", body: given });
      const said = await response.json();
      if (response.ok) return leave(unpairs || !go ? said.go : go);
      wrong.textContent = said.message;
    } catch {
      wrong.textContent = _("No connection. Try again.");
    }
    if (pin) {
      pin.value = "";
      pin.focus();
    }
    wait();
  }

  async function leave(go) {
    left = true;
    if (document.fullscreenElement) await document.exitFullscreen().catch(() => {});
    location.replace(go);
  }

  trap();
  for (const touch of ["pointerup", "keydown"]) document.addEventListener(touch, trap, { once: true });
  addEventListener("popstate", () => {
    if (left) return;
    trap();
    ask();
  });
  document.addEventListener("fullscreenchange", () => document.fullscreenElement || ask());
  document.addEventListener("click", ({ target }) => target.closest("[data-leave]") && ask());
  dialog.querySelector("[data-stay]").addEventListener("click", stay);
  dialog.addEventListener("keydown", (event) => event.key === "Escape" && stay());
  dialog.addEventListener("input", wait);
  form.addEventListener("submit", answer);
}
