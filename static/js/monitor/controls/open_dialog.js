// A question on the PT's page. It is not modal: Pause, Stop robot and Fall stay within reach below it.

document.addEventListener("keydown", ({ key }) => {
  if (key === "Escape") document.querySelector("dialog[open]")?.close("");
});

// Open a dialog; call `answer(value)` once, with "" where it was closed.
export function openDialog(dialog, answer) {
  dialog.returnValue = "";
  for (const other of document.querySelectorAll("dialog[open]")) if (other !== dialog) other.close("");
  if (!dialog.open) dialog.show();
  dialog.onclose = () => answer(dialog.returnValue);
}
