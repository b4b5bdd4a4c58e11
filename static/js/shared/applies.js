// Only what another choice of the form asks for: `data-of` names that choice, `data-is` its values.

for (const part of document.querySelectorAll("[data-is]")) {
  const row = part.closest(".form-row") ?? part;
  const form = row.closest("form");
  const show = () => {
    const chosen = new FormData(form).get(part.dataset.of);
    row.hidden = !part.dataset.is.split(" ").includes(chosen) && !row.classList.contains("errors");
  };
  form.addEventListener("change", show);
  show();
}
