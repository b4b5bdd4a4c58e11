// A tablet that waits shows the clinic's boards, each for a while, as they are at that moment: who no
// longer agrees is gone with the next look.

import { guardLeaving } from "garry/walk/leave_guard";

const EVERY_MS = 5_000;
const place = document.querySelector("[data-boards]");
const calm = document.querySelector(".waits");
let shown = "";

async function look() {
  try {
    const answer = await fetch(place.dataset.boards, { cache: "no-store" });
    const board = answer.ok ? await answer.text() : "";
    if (board !== shown) place.innerHTML = board;
    shown = board;
    place.hidden = !board;
    calm.hidden = Boolean(board);
  } catch {
    // tablet.js says that the server cannot be reached
  }
  setTimeout(look, EVERY_MS);
}

if (place) look();
guardLeaving(document.querySelector("dialog.leave"));
