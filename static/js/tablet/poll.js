// A waiting tablet asks the server where to go: on once its code is approved, to its station's next session.

const EVERY_MS = 2_000;
const note = document.querySelector(".note");

async function ask() {
  try {
    const answer = await fetch(document.body.dataset.state, { cache: "no-store" });
    const { go } = await answer.json();
    note.hidden = true;
    if (go) {
      location.replace(go);
      return;
    }
  } catch {
    note.hidden = false;
  }
  setTimeout(ask, EVERY_MS);
}

setTimeout(ask, EVERY_MS);
