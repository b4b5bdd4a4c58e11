// What was typed in a form and not saved is not left without the browser's question.
const form = document.querySelector("form[data-unsaved]");
let isUnsaved = form.dataset.unsaved === "yes";

form.addEventListener("input", () => (isUnsaved = true));
form.addEventListener("submit", () => (isUnsaved = false));
addEventListener("beforeunload", (event) => isUnsaved && event.preventDefault());
