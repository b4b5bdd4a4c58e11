// The words and the number keep the size that was promised: in degrees, as the patient sees them. What does not fit
// beside them goes, in this order: the chart of strides, the badge, the thermometer, each only if that makes the
// words larger. On a screen that nobody measured no size is promised: the badge stays there if that costs at most a
// tenth, the thermometer, which says most, for two fifths. Where words are smaller than promised the page says by how
// much (`data-short`).
//
// One frame holds for all steps: it follows from the longest phrases and a number of as many digits, so that goal,
// thermometer, badge and total stay where they are. Heights are in units, --u (walk.css).

import { writeTotal } from "garry/walk/total";

const CHART = 1;
const BADGE = 2;
const LAST = 3;
const ENOUGH = 0.99; // of the largest size that is possible
// So much of it must be left where no size is promised, for the chart, the badge and the thermometer to stay.
const WORTH = [ENOUGH, 0.9, 0.6];
const LEAST = 0.1; // of the promised size
const STEP = 0.004; // to which it is found
const STEP_PX = 4; // the same, of the words' width
const TWO = 2.02; // lines, with what is lost by rounding

const EDGE = 24; // of the screen
const AIR = 24; // between words and goal line, goal line and badge
const CHART_REACH = 96; // of the strides above and below the goal line
const BADGE_LEAST = 160;
const BESIDE_CHART = 240; // the least badge: sooner the chart goes
const ABOVE_TIP = 48; // of the goal, words that name it
const SCALE_LEAST = 240; // of the thermometer
const BESIDE_WORDS = 300; // the same across in the middle or a half, whose units are smaller
const UNDER_PAUSE = 48; // the glass, from the words' top
const SCALE_TOP = 150; // from the screen's top, where words stand beside it
const [SPARKS, CAP] = [76, 68]; // above the scale, where words stand over it
const [FOOT, BADGE_FOOT] = [172, 216]; // below the scale: the bulb, or the badge in its place
const SIGN_BESIDE = [54, 28]; // more than AIR, above and below the goal, where its sign is there
const [SIGN_IN_PART, SIGN_UPRIGHT] = [1.25, 1.15]; // larger, where units are smaller or room is
const THICK_IN_PART = 1.16; // the thermometer
const [UNDER_BADGE, UNDER_BADGE_IN_PART] = [254, 298]; // the scale, from that badge's top
const [HALF, HALF_BADGE, BEFORE_SIGN] = [94, 118, 250]; // from the thermometer's axis to the page's margin
const BESIDE_MIDDLE = 249; // the same to the middle, where words and total are beside it

// Return the pixels of one degree on a screen of so many pixels a millimeter, seen from so far.
export const pixelsOfDegree = (pxPerMm, distance_m) => 2 * distance_m * 1000 * Math.tan(Math.PI / 360) * pxPerMm;

// Return the value nearest to `not` that is found to hold, to one `step`; `fits` if none does.
function findLimit(fits, not, step, holds) {
  while (Math.abs(not - fits) > step) {
    const value = (fits + not) / 2;
    if (holds(value)) fits = value;
    else not = value;
  }
  return fits;
}

const largest = (holds) => (holds(1) ? 1 : findLimit(LEAST, 1, STEP, holds));

// Return how much goes, at least so much, and the size of words, in shares of the promised one: the largest that holds.
export function chooseLayout(holds, isMeasured, least) {
  if (holds(least, 1)) return [least, 1];
  const most = largest((size) => holds(LAST, size));
  const worth = (level) => most * (isMeasured ? ENOUGH : WORTH[level]);
  let level = least;
  while (level < LAST && !holds(level, worth(level))) level++;
  if (level === LAST) return [level, most];
  const size = holds(level, most) ? most : findLimit(worth(level), most, STEP, (size) => holds(level, size));
  while (level > least && holds(level - 1, size)) level--; // what is in no word's way
  return [level, size];
}

function sampleOf(text) {
  const sample = Object.assign(document.createElement("span"), { textContent: text });
  sample.style.display = "block";
  return sample;
}

export function createFitting(body, scene) {
  const find = (selector) => body.querySelector(selector);
  const [stage, ground, main, phrase, words] = [".stage", ".ground", "main", ".phrase", ".words"].map(find);
  const [count, key, part, actions] = [".count", ".key", ".part", ".actions"].map(find);
  const landscape = matchMedia("(orientation: landscape)");
  const { pxPerMm, distance } = body.dataset;
  if (pxPerMm) body.style.setProperty("--degree", `${pixelsOfDegree(Number(pxPerMm), Number(distance))}px`);
  let [fitted, widest] = ["", ""];

  const unit = () => parseFloat(getComputedStyle(main).left) / EDGE; // walk.css
  const isTooWide = (box) => box.scrollWidth > box.clientWidth + 1;

  const heights = () => [...words.children].map((sample) => sample.offsetHeight);

  // Return whether a message fits between header and buttons. By its parts' lines: letters reach beyond theirs.
  function holdsMessage() {
    const parts = [...phrase.children].filter((part) => part.offsetHeight);
    const [first, last] = [parts[0], parts.at(-1)];
    const high = last ? last.offsetTop + last.offsetHeight - first.offsetTop : 0;
    return high <= phrase.clientHeight + 1 && !parts.some(isTooWide);
  }

  // Return whether the number is too wide for its place, also as points that were lost.
  function isNumberTooWide(number) {
    const { theme } = body.dataset;
    const mayBeLost = ["negative", "binary"].includes(theme);
    const isTooWideAs = (text) => {
      writeTotal(key, text, theme !== "explicit");
      return isTooWide(key);
    };
    return isTooWideAs(number) || (mayBeLost && isTooWideAs(`−${number}`));
  }

  // Return the frame that holds each of the samples, which `words` has as its children; null if none does.
  function frameOf(level) {
    if (isTooWide(words)) return null;
    const { column, text, theme } = body.dataset;
    const u = unit();
    const total = count.offsetHeight / u;
    let high = Math.max(...heights());
    const isUpright = !landscape.matches;
    const isExplicit = theme === "explicit";
    const isInPart = !isUpright && column; // of the screen, with smaller units
    const isMiddle = !isUpright && column === "center";
    const isLargest = text === "largest";
    const isStacked = column || isLargest; // words, total and thermometer, in one column
    const isOneSided = !isUpright && isStacked;
    const isBelow = isUpright && isStacked; // the total, below the thermometer
    const isAbove = level < LAST && isUpright && isExplicit && !isBelow; // the value, below the words
    const isOnTwoLines = isMiddle ? level < LAST : isLargest && (!column || column === "center");
    if (isOnTwoLines) high = Math.max(high, TWO * parseFloat(getComputedStyle(words).lineHeight));
    const sign = isStacked ? "beside" : isUpright ? "before" : "behind"; // the goal's (scene.js)
    const thick = isInPart ? THICK_IN_PART : 1;
    const signSize = isInPart ? SIGN_IN_PART : isBelow ? SIGN_UPRIGHT : 1;
    const reaching = isOneSided ? signSize : 0; // of the sign, to words and total
    const airAbove = AIR + SIGN_BESIDE[0] * reaching;
    const airBelow = AIR + SIGN_BESIDE[1] * reaching;
    const [width, height] = [stage.clientWidth / u, stage.clientHeight / u];
    const [sky, bottom] = [main.offsetTop / u + high / u + (isAbove ? total : 0) + airAbove, height - EDGE];
    const reach = level < CHART ? CHART_REACH : 0;
    if (level === LAST) return sky + AIR + total > bottom ? null : { goal: (sky + bottom - total) / 2, high };
    const hasBadge = level < BADGE && !isExplicit; // walk.css
    const isOver = hasBadge && isOneSided; // the badge, over the thermometer
    const isBadgeBulb = !isExplicit && isBelow; // the badge is the thermometer's bulb
    const stand = isBelow ? bottom - total - AIR : bottom;
    const zero = stand - (isBadgeBulb ? BADGE_FOOT : FOOT * thick);
    const underBadge = main.offsetTop / u + (isInPart ? UNDER_BADGE_IN_PART : UNDER_BADGE);
    const head = isOver
      ? underBadge
      : isUpright
        ? sky + (isBelow ? CAP : SPARKS)
        : Math.max(SCALE_TOP, isInPart ? main.offsetTop / u + 12 : 0);
    const top = Math.max(head, (3 * (sky + reach) - zero) / 2);
    const goal = zero - (2 / 3) * (zero - top);
    const badge = !hasBadge || isOneSided || isBelow ? 0 : level < CHART ? BESIDE_CHART : BADGE_LEAST;
    const under = reach + airBelow;
    const beside = isBelow || isAbove ? 0 : total;
    const ground = goal + under + (isUpright ? badge + beside : Math.max(badge, beside));
    if (zero - top < (isInPart ? BESIDE_WORDS : SCALE_LEAST) || ground > stand) return null;
    const atEdge = width - EDGE - (isBadgeBulb ? HALF_BADGE : isOneSided || isUpright ? HALF : BEFORE_SIGN);
    const axis = column === "center" ? width / 2 + (isUpright ? 0 : BESIDE_MIDDLE) : atEdge;
    const above = isAbove ? high / u : goal + under - main.offsetTop / u;
    const full = isOneSided && isExplicit ? Math.min(top, main.offsetTop / u + UNDER_PAUSE) : top; // the glass goes on
    return {
      width,
      height,
      sign,
      signSize,
      tipTurn: isUpright ? 1 : -1, // opposite the sign, or in its place
      isBadgeBulb,
      stand,
      axis,
      thick,
      full,
      top,
      zero,
      goal,
      reach,
      above,
      below: total,
      high,
    };
  }

  function set(level, size) {
    body.dataset.drop = level;
    if (size < 1) body.dataset.short = size.toFixed(4);
    else delete body.dataset.short;
    main.style.setProperty("--short", size);
    phrase.style.removeProperty("--measure");
  }

  // Make the words' place as narrow as it can be: so they stand near the thermometer. One line may become two where
  // the frame has room for them; more there are not for that.
  function narrow(high) {
    const two = Math.min(high, TWO * parseFloat(getComputedStyle(words).lineHeight));
    const most = heights().map((height) => Math.max(height, two));
    const width = findLimit(main.clientWidth, 0, STEP_PX, (width) => {
      phrase.style.setProperty("--measure", `${width}px`);
      return !isTooWide(words) && heights().every((height, index) => height <= most[index]);
    });
    phrase.style.setProperty("--measure", `${Math.ceil(width) + 1}px`);
  }

  // Lay out a step's page for all that it may say.
  function fitStep(number) {
    const frame = (level, size) => {
      set(level, size);
      const found = frameOf(level);
      return found && !isNumberTooWide(number) ? found : null;
    };
    // In the middle, or in a half, is no room for the chart; who needs the largest words does not see it.
    const least = body.dataset.column || body.dataset.text === "largest" ? CHART : 0;
    const [level, size] = chooseLayout(frame, Boolean(body.dataset.pxPerMm), least);
    const found = frame(level, size);
    if (!found) return; // a screen so small that nothing fits
    ground.style.setProperty("--floor", `${found.goal * unit()}px`);
    main.style.setProperty("--words-high", `${found.high}px`);
    if (level === LAST) return;
    main.style.setProperty("--above", `${found.above * unit()}px`);
    main.style.setProperty("--below", `${found.below * unit()}px`);
    main.style.setProperty("--words-down", `${(found.goal - ABOVE_TIP) * unit() - main.offsetTop - found.high}px`);
    narrow(found.high);
    scene.layOut({ ...found, isFlipped: body.dataset.side === "left" });
  }

  function fitMessage() {
    const holds = (size) => {
      set(0, size);
      return holdsMessage();
    };
    set(0, largest(holds));
    const foot = Math.max(part.offsetHeight, actions.offsetHeight);
    const below = foot ? foot / unit() + 36 + EDGE : 64;
    ground.style.setProperty("--floor", `${stage.clientHeight - below * unit()}px`);
  }

  // Choose the layout for all that this screen may say: the longest phrases that may follow a step, and a number.
  return function fit(screen, { phrases: samples, number: usual }) {
    const isFeedback = screen === "feedback";
    const shown = key.textContent.replace("−", "").replace(/\d/g, "6");
    widest = [usual, shown].reduce((a, b) => (b.length > a.length ? b : a), widest);
    const number = isFeedback ? widest : "";
    const said = isFeedback ? samples : [phrase.textContent, actions.textContent];
    const { text, column, side, theme } = body.dataset;
    const degree = body.style.getPropertyValue("--degree");
    const { status } = document.fonts;
    const wanted = [screen, said, number, text, column, side, theme, innerWidth, innerHeight, degree, status].join("|");
    if (wanted === fitted) return;
    fitted = wanted;
    if (!isFeedback) return fitMessage();

    const [lines, total] = [[...words.childNodes], key.textContent];
    words.replaceChildren(...samples.map(sampleOf));
    fitStep(number);
    words.replaceChildren(...lines);
    writeTotal(key, total, theme !== "explicit");
  };
}
