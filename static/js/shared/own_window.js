// A link or form with `data-window` ("390 844") opens in a window of that size beside this page, to be seen with it.
//
// Where no window can be opened, it opens in a tab.

const NAME = "garry-beside"; // where a form is sent to

function openBeside(place, address, name) {
  const [width, height] = place.dataset.window.split(" ");
  return open(address, name, `popup,width=${width},height=${height}`);
}

document.addEventListener("click", (event) => {
  const link = event.target.closest("a[data-window]");
  if (!link || event.ctrlKey || event.metaKey || event.shiftKey) return;
  if (openBeside(link, link.href, "")) event.preventDefault();
});
document.addEventListener("submit", ({ target: form }) => {
  if (form.dataset.window && openBeside(form, "", NAME)) form.target = NAME;
});
