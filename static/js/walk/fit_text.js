// On a calm screen large text takes the room above the figure, and shrinks where it needs more.

const SIZES = 4; // as walk.css has them for data-fit
const OVERHANG = 0.02; // of its height: what letters reach beyond their lines, at any size

export function createFitting(body) {
  const phrase = body.querySelector(".phrase");
  const [words, sub] = [phrase.querySelector(".words"), phrase.querySelector(".sub")];
  const sizes = new Map(); // of texts that were fitted before
  addEventListener("resize", () => sizes.clear());

  const overflows = () =>
    phrase.scrollHeight > phrase.clientHeight * (1 + OVERHANG) + 2 || phrase.scrollWidth > phrase.clientWidth + 2;

  return function fit() {
    const text = `${body.dataset.look} ${words.textContent} ${sub.textContent}`;
    if (!sizes.has(text)) {
      let size = 0;
      do phrase.dataset.fit = size;
      while (overflows() && ++size < SIZES);
      sizes.set(text, Math.min(size, SIZES - 1));
    }
    phrase.dataset.fit = sizes.get(text);
  };
}
