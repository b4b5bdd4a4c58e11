// A figure as PNG: the SVG that the server gives out (and notes in its log), painted by the browser.
import { _ } from "garry/shared/language";

const SCALE = 2; // 2000 dots: 300 an inch on a page with margins
const KEPT_MS = 60_000; // a browser may ask where to save first

async function paint(address) {
  const answer = await fetch(address);
  if (!answer.ok) throw new Error(answer.statusText);
  const svg = new DOMParser().parseFromString(await answer.text(), "image/svg+xml").documentElement;
  const { width, height } = svg.viewBox.baseVal;
  svg.setAttribute("width", width); // without them some browsers paint nothing
  svg.setAttribute("height", height);
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg.outerHTML)}`;
  await image.decode();
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [SCALE * width, SCALE * height];
  canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
  return new Promise((done) => canvas.toBlob(done, "image/png"));
}

function save(file, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(file);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), KEPT_MS);
}

for (const button of document.querySelectorAll("button[data-png]")) {
  const wrong = button.parentElement.querySelector("[role=alert]");
  button.addEventListener("click", async () => {
    button.disabled = true;
    wrong.textContent = "";
    try {
      save(await paint(button.value), button.dataset.png);
    } catch {
      wrong.textContent = _("The value did not arrive. Reload the page.");
    }
    button.disabled = false;
  });
}
