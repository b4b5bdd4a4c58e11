// What is typed in a field beside a command stands in the command; empty, as it was. Anything but a plain word is
// quoted; what a shell would take for more than a text, in quotes as well, is refused.

for (const field of document.querySelectorAll("[data-fills]")) {
  const blank = field.closest("details").querySelector(`[data-blank=${field.dataset.fills}]`);
  field.closest("[hidden]")?.removeAttribute("hidden");
  const fill = () => {
    const typed = field.value.trim().replace(/^(\d+),(\d+)$/, "$1.$2");
    field.setCustomValidity(/["$`\\%!]/.test(typed) ? field.dataset.refused : "");
    field.reportValidity();
    const value = (field.validity.valid && typed) || field.defaultValue;
    blank.textContent = /^[\w.:-]+$/.test(value) ? value : `"${value}"`;
  };
  field.addEventListener("input", fill);
  fill(); // a browser may have kept what was typed
}
