// The check of what a patient sees: a letter at a time; what was seen goes to the page of the setting.

import { pixelsOfDegree } from "garry/walk/fit_layout";

const FACTORS = { normal: 1, large: 1.4, largest: 1.8 }; // static/css/walk/layouts.css
const { pxPerMm, distance, then } = document.body.dataset;
const letters = JSON.parse(document.getElementById("letters").textContent);
const letter = document.querySelector(".letter");
const footer = document.querySelector("footer");
const count = footer.querySelector("[role=status]");
let seen = "";

if (pxPerMm) document.body.style.setProperty("--degree", `${pixelsOfDegree(Number(pxPerMm), Number(distance))}px`);

function show() {
  const next = letters[seen.length];
  if (!next) {
    location.assign(`${then}?seen=${seen}`);
    return;
  }
  letter.textContent = next.letter;
  letter.dataset.side = next.side;
  letter.style.setProperty("--factor", FACTORS[next.size]);
  count.textContent = `${seen.length + 1} / ${letters.length}`;
}

document.querySelector("[data-begin]").addEventListener("click", () => {
  document.querySelector("[data-part=before]").hidden = true;
  document.querySelector("[data-part=during]").hidden = footer.hidden = false;
  show();
});
for (const button of document.querySelectorAll("[data-seen]")) {
  button.addEventListener("click", () => {
    seen += button.dataset.seen;
    show();
  });
}
