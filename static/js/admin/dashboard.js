// The week in a drawing: minutes by day. The figures are text beside it, so screen readers skip it.

import { fitViewBox, shape, text } from "garry/shared/svg";

const { days, minutes } = JSON.parse(document.getElementById("week")?.textContent ?? "{}");
const LABEL_HEIGHT = 24; // below the bars
const FIGURE_HEIGHT = 20; // above them

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

const svg = document.querySelector("svg[data-chart]");
if (days) new ResizeObserver(() => drawMinutes(svg)).observe(svg);
