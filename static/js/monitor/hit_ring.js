// The share of hits as a ring, with a tick at the share that is wanted.

import { percent } from "garry/shared/format";
import { shape, text } from "garry/shared/svg";

const CIRCLE = { cx: 80, cy: 80, r: 62 };
const LENGTH = 2 * Math.PI * CIRCLE.r;

function drawArc(rate) {
  const dashes = `${LENGTH * rate} ${LENGTH}`;
  return shape("circle", { class: "arc", ...CIRCLE, "stroke-dasharray": dashes, transform: "rotate(-90 80 80)" });
}

function drawTick(wanted) {
  const edge = shape("path", { class: "tick-edge", d: "M80 4v28" });
  const tick = shape("path", { class: "tick", d: "M80 2v32" });
  return shape("g", { transform: `rotate(${wanted * 360} 80 80)` }, edge + tick);
}

export function drawHitRing(svg, rate, wanted) {
  svg.innerHTML =
    shape("circle", { class: "track", ...CIRCLE }) +
    (rate == null ? "" : drawArc(rate)) +
    (wanted ? drawTick(wanted) : "") +
    text(rate == null ? "–" : percent(rate), { class: "rate", x: 80, y: 80, dy: ".36em" });
}
