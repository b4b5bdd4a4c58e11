// A tablet that waits, or shows old scores, asks the server where to go: on once its code is approved, to its
// station's next session.

const EVERY_MS = 1_000;
const note = document.querySelector("[data-offline]");

function showOffline(isOffline) {
  if (note) note.hidden = !isOffline;
}

async function ask() {
  try {
    const answer = await fetch(document.body.dataset.state, { cache: "no-store" });
    const { go } = await answer.json();
    showOffline(false);
    if (go) {
      location.replace(go);
      return;
    }
  } catch {
    showOffline(true);
  }
  setTimeout(ask, EVERY_MS);
}

setTimeout(ask, EVERY_MS);
