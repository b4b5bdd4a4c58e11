// What was changed or noted, on the strip: flags and badges in a row on top, remarks at the bottom, none of their
// words over another's.

import { number } from "garry/shared/language";
import { shape, text, title } from "garry/shared/svg";
import { badgeOf, describe, isRemark } from "garry/monitor/annotations";

const LETTER = 8; // pixels
const LINE = 16; // pixels

const path = (kind, d) => shape("path", { class: kind, d });

export function drawAnnotations(shown, annotations, { width, floor, dx, x }) {
  let free = 0; // flags and badges never cover each other
  const taken = []; // up to where each line of remarks is written

  function drawGoal(at, value) {
    const left = Math.min(Math.max(at, free), width - 56);
    free = left + 57;
    return (
      path("flag", `M${at} 22V${floor}`) +
      path("cloth", `M${left} 2h54v20h-54z`) +
      text(number(value, 2), { class: "on-cloth", x: left + 27, y: 17 })
    );
  }

  function drawChange(at, change) {
    const cx = Math.min(Math.max(at, free + 9), width - 10);
    free = cx + 11;
    return shape(
      "g",
      { class: "change" },
      title(describe(change)) +
        path("flag", `M${at} 21V${floor}`) +
        shape("circle", { cx, cy: 12, r: 9 }) +
        text(badgeOf(change), { x: cx, y: 16 }),
    );
  }

  function drawRemark(at, remark) {
    const words = describe(remark);
    const half = (LETTER * words.length) / 2;
    const middle = Math.min(Math.max(at, 56 + half), width - half);
    const found = taken.findIndex((until) => until < middle - half);
    const line = found < 0 ? taken.length : found;
    taken[line] = middle + half + LETTER;
    const red = remark.kind === "fall" ? " red" : "";
    const place = { class: `remark-words${red}`, x: middle, y: floor - 14 - LINE * line };
    return path(`remark${red}`, `M${at} ${floor - 2}l-6 -9h12z`) + text(words, place);
  }

  return annotations.map((annotation) => {
    const { after, kind, value } = annotation;
    if (!shown.length || after < shown[0].number) return "";
    const next = shown.findIndex((stride) => stride.number > after);
    const at = next < 0 ? x(shown.length) : x(next) - dx / 2;
    if (kind === "goal") return value === null ? "" : drawGoal(at, value);
    return isRemark(annotation) ? drawRemark(at, annotation) : drawChange(at, annotation);
  });
}
