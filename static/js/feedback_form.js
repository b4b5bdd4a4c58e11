// The form of a feedback type: what a patient sees of each band follows every key.

const PAUSE_MS = 250; // after the last key, before the preview is drawn again

const form = document.querySelector("#feedbacktype_form");
const preview = document.querySelector(".preview");
if (form && preview) follow();

function follow() {
  const frame = preview.querySelector("iframe");
  const seenIn = preview.querySelector("#seen_in");
  let waiting;

  function draw() {
    const given = new FormData(form);
    for (const name of ["csrfmiddlewaretoken", "_save", "_continue"]) given.delete(name);
    for (const name of [...given.keys()]) if (name.includes("__prefix__")) given.delete(name);
    if (preview.dataset.row) given.set("row", preview.dataset.row);
    given.set("seen_in", seenIn.value);
    // The page of the frame is exchanged, so that looking leaves no trail behind the back button.
    frame.contentWindow.location.replace(`${preview.dataset.preview}?${new URLSearchParams(given)}`);
  }

  function soon() {
    clearTimeout(waiting);
    waiting = setTimeout(draw, PAUSE_MS);
  }

  seenIn.addEventListener("change", draw);
  for (const kind of ["input", "change", "formset:added", "formset:removed"]) document.addEventListener(kind, soon);
  draw();
}
