// The words and the number keep the size that was promised: in degrees, as the patient sees them. What does not fit
// beside them goes, in this order: the chart of strides, the emblem, the scene. Only where even words and number alone
// are too large for the screen they become smaller; the page then says by how much (`data-short`). On a screen that
// nobody measured no size is promised: the thermometer, which says most, stays there if that costs at most a quarter.

const CHART = 1;
const EMBLEM = 2;
const LEVELS = [0, CHART, EMBLEM, 3];
const WORTH = 0.75; // of the words' size: so much the thermometer may cost where no size is promised
const LEAST = 0.1; // of the promised size
const HALVINGS = 9; // of the search for what fits

// Return the pixels of one degree on a screen of so many pixels a millimeter, seen from so far.
export const pixelsOfDegree = (pxPerMm, distance_m) => 2 * distance_m * 1000 * Math.tan(Math.PI / 360) * pxPerMm;

export function createFitting(body, scene) {
  const find = (selector) => body.querySelector(selector);
  const [stage, phrase, words, count, key] = [".stage", ".phrase", ".words", ".count", ".key"].map(find);
  const { pxPerMm, distance } = body.dataset;
  if (pxPerMm) body.style.setProperty("--degree", `${pixelsOfDegree(Number(pxPerMm), Number(distance))}px`);
  let fitted = "";

  // By its parts' lines: letters reach beyond theirs at any size.
  function overflows(box) {
    const parts = [...box.children].filter((part) => part.offsetHeight);
    if (!parts.length) return false;
    const [first, last] = [parts[0], parts.at(-1)];
    const isHigh = last.offsetTop + last.offsetHeight - first.offsetTop > box.clientHeight + 1;
    return isHigh || parts.some((part) => part.scrollWidth > box.clientWidth + 1);
  }

  function tooLarge(samples, number) {
    const [was, had] = [[...words.childNodes], key.textContent];
    key.textContent = number;
    if (number) measureSky(samples);
    const bottom = count.offsetTop + count.offsetHeight;
    let isTooLarge = Boolean(number) && (overflows(count) || bottom > count.parentElement.clientHeight + 1);
    for (const sample of samples) {
      if (isTooLarge) break;
      words.textContent = sample;
      isTooLarge = overflows(phrase);
    }
    words.replaceChildren(...was);
    key.textContent = had;
    return isTooLarge;
  }

  // The phrase's row becomes as high as its longest sample, so that the scene gets all that is left. Return between
  // which heights the horizon may lie, in shares of the stage.
  function measureSky(samples) {
    const was = [...words.childNodes];
    let height = 0;
    for (const sample of samples) {
      words.textContent = sample;
      height = Math.max(height, words.offsetHeight);
    }
    words.replaceChildren(...was);
    body.style.setProperty("--phrase", `${height}px`);
    const { top, height: whole } = stage.getBoundingClientRect();
    const label = [...count.children].find((part) => part.offsetHeight) ?? count;
    const ends = [phrase.getBoundingClientRect().bottom, label.getBoundingClientRect().top];
    return ends.map((end) => (end - top) / whole);
  }

  function set(drop, short) {
    body.style.removeProperty("--phrase");
    body.dataset.drop = drop;
    if (short < 1) body.dataset.short = short.toFixed(4);
    else delete body.dataset.short;
    body.style.setProperty("--short", short);
  }

  // Choose the layout for all that this screen may say: of feedback its longest phrases, so that it stays as it is
  // from step to step.
  return function fit(screen, session) {
    const isFeedback = screen === "feedback";
    const samples = isFeedback && session.words_shown !== false ? (session.longest ?? []) : [];
    const number = isFeedback ? key.textContent.replace(/\d/g, "8").padStart(3, "8") : "";
    const told = isFeedback ? "" : find(".phrase").textContent;
    const { text, column, side } = body.dataset;
    const degree = body.style.getPropertyValue("--degree");
    const wanted = [screen, samples, number, told, text, column, side, innerWidth, innerHeight, degree].join("|");
    if (wanted === fitted) return;
    fitted = wanted;
    const shown = [...samples, words.textContent];
    const levels = isFeedback ? LEVELS.slice(column === "center" ? CHART : 0) : [0, CHART];
    let level;
    let fits = LEAST;
    for (level of levels) {
      set(level, 1);
      if (!tooLarge(shown, number)) break;
      if (level !== EMBLEM && !(level && column)) continue;
      if (body.dataset.pxPerMm) continue;
      set(level, WORTH);
      if (tooLarge(shown, number)) continue;
      fits = WORTH;
      break;
    }
    set(level, 1);
    if (tooLarge(shown, number)) {
      let not = 1;
      for (let i = 0; i < HALVINGS; i++) {
        const short = (fits + not) / 2;
        set(level, short);
        if (tooLarge(shown, number)) not = short;
        else fits = short;
      }
      set(level, fits);
    }
    scene.layOut(level, isFeedback && level ? measureSky(shown) : null);
  };
}
