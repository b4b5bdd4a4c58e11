// A note that is typed. It is no part of the log: it stands on the session's page, and can be corrected there.

import { _ } from "garry/shared/language";
import { openDialog } from "garry/monitor/controls/open_dialog";

export function createNote({ announce, onPress }) {
  const dialog = document.getElementById("written");
  const form = dialog.querySelector("form");

  onPress("[data-write]", () => {
    openDialog(dialog, () => {});
    form.elements.note.focus();
  });
  onPress("#written [data-close]", () => dialog.close(""));

  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    try {
      const answer = await fetch(form.action, { method: "POST", body: new FormData(form) });
      const { message } = await answer.json();
      announce(message);
      if (!answer.ok) return;
      form.reset();
      dialog.close("");
    } catch {
      announce(_("There is no connection. Try again in a moment."));
    }
  });

  return {};
}
