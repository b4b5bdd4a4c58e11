// A protocol drawn as it will be walked: a block for each phase, as wide as it is long.

import { clock } from "garry/shared/format";
import { fitText, shape, text, title } from "garry/shared/svg";

const NARROWEST = 52; // pixels of a phase
const LETTER = 7; // pixels of a letter of its name
const LETTERS_MAX = 20; // that no phase is widened for
const OPEN_PHASE_S = 300; // a phase without an end is drawn as if it took this long
const GROUND = 92;
const MINUTE_FROM_S = 90; // of a time that follows from strides
const MINUTE_WITHIN_S = 5; // fifty strides count as a minute

// Divide the room by weight, so that no part is narrower than its least width.
function divide(room, weights, least) {
  const narrow = new Set();
  for (;;) {
    const left = room - least.reduce((all, width, index) => (narrow.has(index) ? all + width : all), 0);
    const sum = weights.reduce((all, weight, index) => (narrow.has(index) ? all : all + weight), 0) || 1;
    const widths = weights.map((weight, index) => (narrow.has(index) ? least[index] : (weight / sum) * left));
    const next = widths.findIndex((width, index) => width < least[index] && !narrow.has(index));
    if (next < 0) return widths;
    narrow.add(next);
  }
}

// Return a phase's length in seconds; null where it has no end.
function lengthOf({ strides, seconds }, stride_s) {
  const limits = [seconds, strides && strides * stride_s].filter(Boolean);
  return limits.length ? Math.min(...limits) : null;
}

// `labels`: how an open phase, minutes, and all of it are written where it is open; `stride_s`: a stride's length.
// Returns how long all of it takes.
export function drawProtocol(svg, phases, { width: room, stride_s, labels }) {
  const lengths = phases.map((phase) => lengthOf(phase, stride_s));

  // A time that was set is written to the second.
  function formatLength(seconds, isSet = false) {
    if (seconds === null) return labels.open;
    if (isSet && seconds > 60 && seconds % 60) return `${clock(seconds)} ${labels.minutes}`;
    const minutes = Math.round(seconds / 60);
    const isMinute = Math.abs(seconds - 60) <= MINUTE_WITHIN_S;
    return seconds < MINUTE_FROM_S && !isMinute ? `${Math.round(seconds)} s` : `${minutes} ${labels.minutes}`;
  }

  function drawPhase(phase, index, left, width) {
    const letters = Math.floor((width - 8) / LETTER);
    const isOpen = lengths[index] === null;
    const height = phase.feedback ? 64 : 18;
    const kind = `${phase.feedback ? "on" : "off"}${isOpen ? " endless" : ""}`;
    const block = { x: left + 2, y: GROUND - height, width: width - 4, height, rx: 4 };
    const gain = { class: "gain", x: left + width / 2, y: GROUND + 18 - height };
    const length = formatLength(lengths[index], lengths[index] === phase.seconds);
    return shape(
      "g",
      {},
      title(phase.name) +
        shape("rect", { class: kind, ...block }) +
        text(fitText(phase.name, letters), { class: "name", x: left + 6, y: 16 }) +
        (phase.feedback && phase.gain !== 1 ? text(`${Math.round(100 * phase.gain)} %`, gain) : "") +
        text(isOpen && length.length > letters ? "…" : length, { class: "length", x: left + 6, y: GROUND + 20 }),
    );
  }

  const weights = lengths.map((seconds) => seconds ?? OPEN_PHASE_S);
  const least = phases.map(({ name }) => Math.max(NARROWEST, Math.min(name.length, LETTERS_MAX) * LETTER + 8));
  const widths = divide(room, weights, least);
  const width = widths.reduce((all, one) => all + one, 0);
  let left = 0;
  const drawn = phases.map((phase, index) => {
    const block = drawPhase(phase, index, left, widths[index]);
    left += widths[index];
    return block;
  });
  svg.setAttribute("viewBox", `0 0 ${Math.max(width, 1)} ${GROUND + 28}`);
  svg.setAttribute("width", Math.max(width, 1));
  svg.innerHTML = drawn.join("") + shape("path", { class: "ground", d: `M0 ${GROUND + 1}H${width}` });

  const known_s = lengths.reduce((all, one) => all + (one ?? 0), 0);
  const firstOpen = lengths.indexOf(null);
  if (!known_s) return phases.length ? labels.end : "";
  if (firstOpen < 0) return formatLength(known_s);
  const words = firstOpen === lengths.length - 1 ? labels.then : labels.between;
  return words.replace("{time}", formatLength(known_s));
}
