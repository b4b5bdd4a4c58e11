// The strip of recent strides against the goal, with phases, changes and remarks. Shape repeats the meaning of
// color: hits are solid, misses hollow, missing ones a dash.

import { number } from "garry/shared/language";
import { percent } from "garry/shared/format";
import { phaseName } from "garry/shared/labels";
import { fitViewBox, shape, text, title } from "garry/shared/svg";
import { badgeOf, describe, isRemark } from "garry/monitor/annotations";

const [LOWEST, HIGHEST] = [0.5, 1.5]; // performance
const SPACING = 4; // pixels between strides, at least
const FEWEST = 60; // strides that the width is made for
const LETTER = 8; // pixels

const path = (kind, d) => shape("path", { class: kind, d });

export function drawStrip(svg, strides, annotations, phases) {
  const [width, height] = fitViewBox(svg);
  const shown = strides.slice(-Math.max(20, Math.floor((width - 60) / SPACING)));
  const dx = (width - 60) / Math.max(shown.length - 1, FEWEST);
  const x = (index) => 46 + index * dx;
  const y = (performance) => {
    const inside = Math.min(Math.max(performance, LOWEST), HIGHEST);
    return height - 8 - ((inside - LOWEST) * (height - 34)) / (HIGHEST - LOWEST);
  };

  function drawScale() {
    const size = { x: 40, y: y(HIGHEST), width: width - 40, height: y(1) - y(HIGHEST) };
    const labels = [0.5, 1, 1.5].map((share) => text(percent(share), { x: 0, y: y(share) + 5 }));
    return [shape("rect", { class: "above", ...size }), ...labels, path("goal", `M40 ${y(1)}H${width}`)];
  }

  function drawStride({ performance, hit, valid }, index) {
    if (performance == null) {
      return valid
        ? shape("circle", { class: "calm", cx: x(index), cy: height - 10, r: 3.2 })
        : path("gap", `M${x(index)} ${height - 8}v-10`);
    }
    const r = index === shown.length - 1 ? 6 : 3.2;
    return shape("circle", { class: hit ? "hit" : "miss", cx: x(index), cy: y(performance), r });
  }

  function drawPhases() {
    const starts = [...shown.keys()].filter(
      (index) => index && shown[index].phase !== undefined && shown[index].phase !== shown[index - 1].phase,
    );
    return starts.map((index, n) => {
      const left = x(index) - dx / 2;
      const room = (n + 1 < starts.length ? x(starts[n + 1]) : width) - left;
      const name = phaseName(phases[shown[index].phase]?.name ?? "");
      const label = room < LETTER * name.length ? "" : text(name, { class: "part", x: left + 5, y: 40 });
      return path("bound", `M${left} 4V${height - 8}`) + label;
    });
  }

  function drawAnnotations() {
    let level = 0; // remarks at the same stride stand above each other
    let previous = null;
    let free = 0; // badges and flags stand in a row on top and never cover each other

    function drawGoal(at, value) {
      const left = Math.min(Math.max(at, free), width - 56);
      free = left + 57;
      return (
        path("flag", `M${at} 4V${height - 8}`) +
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
          path("flag", `M${at} 21V${height - 8}`) +
          shape("circle", { cx, cy: 12, r: 9 }) +
          text(badgeOf(change), { x: cx, y: 16 }),
      );
    }

    function drawRemark(at, remark) {
      level = remark.after === previous ? level + 1 : 0;
      previous = remark.after;
      const place = { x: Math.min(Math.max(at, 80), width - 40), y: height - 16 - 13 * level };
      return (
        path("remark", `M${at} ${height - 4}l-6 -9h12z`) + text(describe(remark), { class: "remark-words", ...place })
      );
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

  svg.innerHTML = [...drawScale(), ...shown.map(drawStride), ...drawPhases(), ...drawAnnotations()].join("");
}
