// The size of this screen: a drawing that is made as wide as a bank card, or the screen's diagonal; and how large it
// shows each size of words.

import { pixelsOfDegree } from "garry/walk/fit_layout";

const INCH_MM = 25.4;
const USUAL = 4; // pixels a millimeter, to begin with
const FINE = 0.005; // of the size, by a tap
const DIAGONAL = Math.hypot(screen.width, screen.height); // pixels
// Of a page of words and a number: letters of the longest phrase and word (rehab/training/phrases.py), their width, a
// line's height and the number's with its label.
const LETTERS = { phrase: 30, word: 12 };
const LETTER_WIDTH = 0.56;
const LINE = 1.04;
const NUMBER = 2.1;
const STEP = 5; // percent
const USED = { width: 0.93, height: 0.85 }; // of the screen

const form = document.querySelector("main form");
const [width, diagonal] = ["[data-width]", "[data-diagonal]"].map((name) => form.querySelector(name));
const { px_per_mm: field, distance_m: distance } = form.elements;

function isHeld(word) {
  const inLine = Math.floor((USED.width * screen.width) / (word * LETTER_WIDTH));
  const lines = Math.ceil(LETTERS.phrase / inLine);
  return inLine >= LETTERS.word && word * (lines * LINE + NUMBER) <= USED.height * screen.height;
}

function show(pxPerMm) {
  width.value = pxPerMm;
  form.querySelector(".bank-card").style.setProperty("--px-per-mm", pxPerMm);
  const degree = pixelsOfDegree(pxPerMm, Number(distance.value));
  let isShort = false;
  for (const row of form.querySelectorAll("[data-factor]")) {
    let percent = 100;
    while (percent > STEP && !isHeld((degree * Number(row.dataset.factor) * percent) / 100)) percent -= STEP;
    row.querySelector("output").value = percent < 100 ? `≈ ${percent} %` : "100 %";
    row.firstElementChild.classList.toggle("warn", percent < 100);
    isShort ||= percent < 100;
  }
  form.querySelector("[data-short]").hidden = !isShort;
}

function tellDiagonal(pxPerMm) {
  if (document.activeElement !== diagonal) diagonal.value = (DIAGONAL / (pxPerMm * INCH_MM)).toFixed(1);
}

function take(pxPerMm) {
  field.value = pxPerMm.toFixed(3);
  tellDiagonal(pxPerMm);
  show(pxPerMm);
}

width.addEventListener("input", () => take(Number(width.value)));
diagonal.addEventListener("input", () => {
  const inches = Number(diagonal.value);
  if (inches > 0) take(DIAGONAL / (inches * INCH_MM));
});
for (const button of form.querySelectorAll("[data-by]"))
  button.addEventListener("click", () => take(Number(field.value || USUAL) * (1 + FINE * Number(button.dataset.by))));
distance.addEventListener("change", () => show(Number(field.value || USUAL)));
if (field.value) tellDiagonal(Number(field.value));
show(Number(field.value || USUAL));
