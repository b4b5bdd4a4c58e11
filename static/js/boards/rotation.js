// A waiting tablet shows the clinic's boards in turn. Each is requested when it is shown, so that patients who
// no longer agree disappear.

import { guardLeaving } from "garry/walk/leave_guard";

const EVERY_MS = 5_000;
const container = document.querySelector("[data-boards]");
const idleText = document.querySelector(".waits");
let shown = "";

async function showNext() {
  try {
    const answer = await fetch(container.dataset.boards, { cache: "no-store" });
    const board = answer.ok ? await answer.text() : "";
    if (board !== shown) container.innerHTML = board;
    shown = board;
    container.hidden = !board;
    idleText.hidden = Boolean(board);
  } catch {
    // poll.js shows that the server cannot be reached
  }
  setTimeout(showNext, EVERY_MS);
}

if (container) showNext();
guardLeaving(document.querySelector("dialog.leave"));
