// The week in two drawings: minutes by day, hits by feedback type with what was wanted.
// The figures are text beside them, so screen readers skip the drawings.

import { percent } from "garry/shared/format";
import { fitViewBox, shape, text } from "garry/shared/svg";

const { days, minutes, types } = JSON.parse(document.getElementById("week")?.textContent ?? "{}");
const LABEL_HEIGHT = 24; // below the bars
const FIGURE_HEIGHT = 20; // above them
const NAME_WIDTH = 92;
const SHARE_WIDTH = 52;

function drawMinutes(svg) {
  const [width, height] = fitViewBox(svg);
  const most = Math.max(...minutes, 1);
  const step = width / days.length;
  const ground = height - LABEL_HEIGHT;
  const bars = minutes.map((walked, day) => {
    const size = walked ? Math.max(3, (walked / most) * (ground - FIGURE_HEIGHT)) : 0;
    const x = step * (day + 0.5);
    const bar = { x: step * (day + 0.18), y: ground - size, width: step * 0.64, height: size, rx: 3 };
    const figure = { class: "figure", x, y: ground - size - 6 };
    return (
      (walked ? shape("rect", { class: "bar", ...bar }) + text(Math.round(walked) || "<1", figure) : "") +
      text(days[day], { x, y: height - 6 })
    );
  });
  svg.innerHTML = bars.join("") + shape("path", { class: "ground", d: `M0 ${ground}H${width}` });
}

function drawTypes(svg) {
  const [width, height] = fitViewBox(svg);
  const room = width - NAME_WIDTH - SHARE_WIDTH;
  const step = height / Math.max(types.length, 3);
  const rows = types.map(({ label, hit, wanted }, row) => {
    const middle = step * (row + 0.5);
    const size = Math.min(26, step * 0.6);
    const place = { x: NAME_WIDTH, y: middle - size / 2, height: size, rx: 3 };
    const tick = `M${NAME_WIDTH + (room * wanted) / 100} ${middle - size * 0.75}v${size * 1.5}`;
    return (
      text(label, { class: "name", x: 0, y: middle + 5 }) +
      shape("rect", { class: "track", ...place, width: room }) +
      shape("rect", { class: "bar", ...place, width: (room * hit) / 100 }) +
      (wanted ? shape("path", { class: "wanted-edge", d: tick }) + shape("path", { class: "wanted", d: tick }) : "") +
      text(percent(hit / 100), { class: "share", x: width, y: middle + 5 })
    );
  });
  svg.innerHTML = rows.join("");
}

if (days) {
  const drawings = { minutes: drawMinutes, types: drawTypes };
  for (const svg of document.querySelectorAll("svg[data-chart]")) {
    new ResizeObserver(() => drawings[svg.dataset.chart](svg)).observe(svg);
  }
}
