// What is typed in a field beside a command stands in the command; empty, as it was; with a space, in quotes.

for (const field of document.querySelectorAll("[data-fills]")) {
  const blank = field.closest("details").querySelector(`[data-blank=${field.dataset.fills}]`);
  const fill = () => {
    const value = field.value.trim() || field.defaultValue;
    blank.textContent = /\s/.test(value) ? `"${value}"` : value;
  };
  field.addEventListener("input", fill);
  fill(); // a browser may have kept what was typed
}
