// Beside a form of the admin: a frame with what the form would make, drawn again after each change.

const PAUSE_MS = 250; // after the last key, before the frame is drawn again
const CHANGES = ["input", "change", "formset:added", "formset:removed"]; // Django tells the rows

// `preview` holds the frame, the address that draws it, and as whom it is seen (a select).
export function showPreview(form, preview, drawn = () => {}) {
  const frame = preview.querySelector("iframe");
  const eyes = preview.querySelector("select");
  let waiting;

  function draw() {
    const given = new FormData(form);
    for (const name of [...given.keys()]) {
      if (name === "csrfmiddlewaretoken" || name.startsWith("_") || name.includes("__prefix__")) given.delete(name);
    }
    if (preview.dataset.row) given.set("row", preview.dataset.row);
    given.set(eyes.name, eyes.value);
    // The frame's page is exchanged, so that looking leaves no trail behind the back button.
    frame.contentWindow.location.replace(`${preview.dataset.preview}?${new URLSearchParams(given)}`);
  }

  function soon() {
    clearTimeout(waiting);
    waiting = setTimeout(draw, PAUSE_MS);
  }

  frame.addEventListener("load", () => drawn(frame.contentDocument));
  for (const kind of CHANGES) document.addEventListener(kind, soon);
  draw();
}
