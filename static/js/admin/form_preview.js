// The preview of a form in the admin: a frame with what the form would make, drawn again after each change.

const PAUSE_MS = 250; // after the last key, before the frame is drawn again
const CHANGES = ["input", "change", "formset:added", "formset:removed"]; // and those of Django's inlines

// `preview` holds the frame, the URL that draws it, and a select of the viewer; `onDrawn` gets the document drawn.
export function showPreview(form, preview, onDrawn = () => {}) {
  const frame = preview.querySelector("iframe");
  const viewer = preview.querySelector("select");
  let timer;

  function draw() {
    const data = new FormData(form);
    for (const name of [...data.keys()]) {
      if (name === "csrfmiddlewaretoken" || name.startsWith("_") || name.includes("__prefix__")) data.delete(name);
    }
    if (preview.dataset.row) data.set("row", preview.dataset.row);
    data.set(viewer.name, viewer.value);
    // The frame's page is exchanged, so that the preview adds nothing to the browser's history.
    frame.contentWindow.location.replace(`${preview.dataset.preview}?${new URLSearchParams(data)}`);
  }

  function scheduleDraw() {
    clearTimeout(timer);
    timer = setTimeout(draw, PAUSE_MS);
  }

  frame.addEventListener("load", () => onDrawn(frame.contentDocument));
  for (const kind of CHANGES) document.addEventListener(kind, scheduleDraw);
  draw();
}
