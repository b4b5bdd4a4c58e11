// Trend of a patient's sessions: hits against what was wanted, mean against goal and baseline.
import { number } from "garry/shared/language";
import { color, draw, isNarrow } from "garry/charts/chart";

const LABELED = 14; // more points leave no room for figures
const data = document.getElementById("trend");
const { hits, values } = data ? JSON.parse(data.textContent) : {};

function days(labels, element) {
  const narrow = isNarrow(element);
  return {
    xAxis: {
      space: narrow ? 62 : 76,
      incrs: [1, 2, 5, 10],
      // Counted from the last session, which always has its day, as the first one has.
      splits: (_, axis, low, high, step) =>
        [...labels.keys()].filter((index) => !index || (index >= step && (labels.length - 1 - index) % step === 0)),
      values: (_, ticks) => ticks.map((tick) => labels[tick] ?? ""),
    },
    padding: [18, narrow ? 4 : 30, 0, 0],
    cursor: { show: false },
  };
}

const SIGNS = { positive: "+", negative: "−", binary: "±", explicit: "=" };

const between = (low, value, high) => Math.min(high, Math.max(low, value));

// Return the width of a session's share of the chart [px].
const roomOf = (marks, count) => marks.box.width / marks.unit / count;

// A session's mark is that of its feedback type, in the colors of the key.
function drawType(marks, x, y, type, room) {
  const style = getComputedStyle(document.querySelector(`.key [data-theme="${type}"]`));
  const radius = between(6, 0.26 * room, 11);
  marks.disc(x, y, radius, style.borderColor);
  marks.disc(x, y, radius - 1.5, style.backgroundColor);
  const size = 1.45 * radius;
  const middle = marks.y(y) + 0.36 * size * marks.unit;
  marks.text(SIGNS[type] ?? "", marks.x(x), middle, { size, weight: 800, fill: color("ink") });
}

// The range of x leaves half a session on each side, so that marks are whole.
function sessions(count) {
  return { x: { time: false, range: () => [-0.5, count - 0.5] } };
}

function drawHits(element) {
  const count = hits.days.length;
  draw(element, {
    ...days(hits.days, element),
    data: [hits.days.map((_, index) => index), hits.hit],
    // Sessions of several feedback types are no one course.
    series: [
      hits.joined
        ? { stroke: () => color("c-hit"), width: 3, points: { show: false } }
        : { paths: () => null, points: { show: false } },
    ],
    scales: { ...sessions(count), y: { range: () => [0, 100] } },
    yAxis: { values: (_, ticks) => ticks.map((tick) => `${number(tick)} %`), incrs: [20, 25, 50], size: 56 },
    paint: (marks) => {
      const room = roomOf(marks, count);
      hits.hit.forEach((hit, index) => {
        if (hit === null) return; // imported: only its points are known
        const wanted = hits.wanted[index];
        if (wanted) marks.dash(index, wanted, color("c-goal"), room);
        drawType(marks, index, hit, hits.types[index], room);
        if (count > LABELED) return;
        const below = hit > 88 || (wanted && wanted > hit && wanted - hit < 16);
        const y = marks.y(hit) + (below ? 30 : -17) * marks.unit;
        marks.text(number(hit), marks.x(index), y, { size: 17, weight: 800, fill: color("text") });
      });
    },
  });
}

function drawValues(element) {
  const count = values.days.length;
  const span = (index) => [values.mean[index] - values.deviation[index], values.mean[index] + values.deviation[index]];
  const seen = values.days.flatMap((_, i) => [
    ...(values.mean[i] === null ? [] : span(i)),
    ...[values.goal[i], values.baseline[i]].filter((value) => value !== null),
  ]);
  if (!seen.length) return; // imported sessions alone, which kept no values
  const [low, high] = [Math.min(...seen), Math.max(...seen)];
  const air = 0.08 * (high - low || 1);
  draw(element, {
    ...days(values.days, element),
    data: [values.days.map((_, index) => index), values.mean],
    series: [{ paths: () => null, points: { show: false } }],
    scales: { ...sessions(count), y: { range: () => [Math.max(0, low - air), high + air] } },
    yAxis: { values: (_, ticks) => ticks.map((tick) => number(tick, 1)), space: 40 },
    paint: (marks) => {
      const room = roomOf(marks, count);
      values.days.forEach((_, index) => {
        if (values.mean[index] !== null) {
          marks.bar(index, ...span(index), color("edge"));
        }
        if (values.goal[index] !== null) marks.dash(index, values.goal[index], color("c-goal"), room);
        if (values.mean[index] !== null) drawType(marks, index, values.mean[index], values.types[index], room);
        if (values.baseline[index] !== null) {
          const aside = count > LABELED ? 0 : Math.min(20, 0.38 * room); // clear of its neighbor
          marks.square(index, values.baseline[index], between(3, 0.13 * room, 6), color("c-third"), -aside);
        }
      });
    },
  });
}

if (hits) {
  drawHits(document.querySelector("[data-chart=hits]"));
  drawValues(document.querySelector("[data-chart=values]"));
}
