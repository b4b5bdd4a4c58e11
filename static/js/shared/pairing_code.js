// A code that is typed whole asks for itself what there is to compare.

document.addEventListener("input", ({ target }) => {
  if (target.value.trim().length === Number(target.dataset.sendAt)) target.form.requestSubmit();
});
