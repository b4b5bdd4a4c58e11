// The number of the page: a total of points, or a step's value.

const SHORT = 3; // signs

// Write the number, with what its look depends on (walk.css). Return whether it is another one.
export function writeTotal(key, text, isTotal) {
  key.toggleAttribute("data-lost", isTotal && text.startsWith("−"));
  key.toggleAttribute("data-long", isTotal && text.length > SHORT);
  key.dataset.ends = text.at(-1) ?? "";
  const isNew = key.textContent !== text;
  if (isNew) key.textContent = text;
  return isNew;
}
