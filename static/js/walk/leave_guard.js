// Nobody leaves a patient's page by accident: going back, leaving the full screen and the Leave button ask
// first, for the station's PIN where it has one. The dialog is not modal, so that Pause and End stay.

import { _ } from "garry/shared/language";

const OPEN_MS = 30_000; // after which an unanswered question closes

export function guardLeaving(dialog) {
  const form = dialog.querySelector("form");
  const wrong = dialog.querySelector(".wrong");
  const pin = form.elements.pin;
  let timer, hasLeft, focusedBefore;

  // An entry of the history to go back to; browsers pass over those that were made before a touch.
  const addHistoryEntry = () => history.pushState({ stays: true }, "");

  function ask() {
    if (hasLeft) return;
    if (!dialog.open) {
      focusedBefore = document.activeElement;
      form.reset();
      wrong.textContent = "";
      dialog.show();
    }
    (pin ?? dialog.querySelector("[data-stay]")).focus();
    restartTimer();
  }

  function stay() {
    clearTimeout(timer);
    dialog.close();
    if (focusedBefore?.checkVisibility()) focusedBefore.focus();
  }

  function restartTimer() {
    clearTimeout(timer);
    timer = setTimeout(stay, OPEN_MS);
  }

  async function answer(event) {
    event.preventDefault();
    const unpairs = event.submitter?.name === "unpair";
    const { go } = dialog.dataset;
    if (!pin && !unpairs && go) return leave(go);
    const given = new FormData(form, event.submitter);
    try {
      const response = await fetch(form.action, { method: "POST", body: given });
      const answered = await response.json();
      if (response.ok) return leave(unpairs || !go ? answered.go : go);
      wrong.textContent = answered.message;
    } catch {
      wrong.textContent = _("No connection. Try again.");
    }
    if (pin) {
      pin.value = "";
      pin.focus();
    }
    restartTimer();
  }

  async function leave(go) {
    hasLeft = true;
    if (document.fullscreenElement) await document.exitFullscreen().catch(() => {});
    location.replace(go);
  }

  addHistoryEntry();
  for (const touch of ["pointerup", "keydown"]) document.addEventListener(touch, addHistoryEntry, { once: true });
  addEventListener("popstate", () => {
    if (hasLeft) return;
    addHistoryEntry();
    ask();
  });
  document.addEventListener("fullscreenchange", () => document.fullscreenElement || ask());
  document.addEventListener("click", ({ target }) => target.closest("[data-leave]") && ask());
  dialog.querySelector("[data-stay]").addEventListener("click", stay);
  dialog.addEventListener("keydown", (event) => event.key === "Escape" && stay());
  dialog.addEventListener("input", restartTimer);
  form.addEventListener("submit", answer);
}
