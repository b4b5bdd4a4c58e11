// The last strides as bars above and below the goal; hatched where nothing was measured.

import { notReaching } from "garry/shared/format";
import { number } from "garry/shared/language";
import { fitViewBox, shape, text } from "garry/shared/svg";

const HATCH = shape(
  "pattern",
  { id: "hatch", width: 7, height: 7, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" },
  shape("path", { class: "gap", d: "M0 0V7" }),
);

export function drawLastStrides(svg, strides, count, performanceOf, span) {
  const [fullWidth, fullHeight] = fitViewBox(svg);
  const goal = fullHeight * 0.55;
  if (goal < 30) return (svg.innerHTML = ""); // no room, as below the banners of a small screen
  const scale = (fullHeight * 0.95) / span;
  const dx = fullWidth / count;
  const width = dx * 0.68;

  function drawStride(stride, index) {
    const { performance, hit, close, valid } = stride;
    const x = (count - strides.length + index) * dx + dx * 0.16;
    if (performance == null) {
      const level = goal - ((performanceOf(stride) ?? -Infinity) - 1) * scale; // without a goal at the bottom
      const cy = Math.min(Math.max(level, 10), fullHeight - 10);
      return valid
        ? shape("circle", { class: "calm", cx: x + width / 2, cy, r: 5 })
        : shape("rect", { x, y: goal - 22, width, height: 44, rx: 4, fill: "url(#hatch)" });
    }
    const size = Math.min(Math.max(4, Math.abs(performance - 1) * scale), goal - 22);
    const below = { x: x + 1.5, y: goal, width: width - 3, height: Math.min(size, fullHeight - goal - 4) };
    const bar = hit
      ? shape("rect", { class: close ? "close" : "hit", x, y: goal - size, width, height: size, rx: 4 })
      : shape("rect", { class: close ? "close" : "miss", ...below, rx: 4 });
    if (index < strides.length - 1) return bar;
    const y = hit ? goal - size - 8 : Math.min(goal + size + 17, fullHeight - 4);
    return bar + text(number(100 * notReaching(performance)), { class: "newest", x: x + width, y });
  }

  const line = shape("path", { class: "goal", d: `M0 ${goal}H${fullWidth}` });
  svg.innerHTML = shape("defs", {}, HATCH) + strides.map(drawStride).join("") + line;
}
