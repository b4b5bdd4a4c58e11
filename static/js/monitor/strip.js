// The strip of recent strides, by minutes: against the goal, or before there is one, in the measure's own unit with
// their running mean ± SD. Shape repeats the meaning of color: hits are solid, misses hollow, missing ones a dash.

import { _, number } from "garry/shared/language";
import { percent } from "garry/shared/format";
import { phaseName } from "garry/shared/labels";
import { fitViewBox, shape, text } from "garry/shared/svg";
import { drawAnnotations } from "garry/monitor/strip_annotations";

const SPACING = 4; // pixels between strides, at least
const FEWEST = 30; // strides that the width is made for
const LETTER = 8; // pixels
const AXIS = 18; // pixels, for the minutes
const HEAD = 30; // pixels above the scale, for flags
const NAMES = 16; // pixels more, for names of phases
const LANE = 20; // pixels below the scale, for strides that were not measured
const MINUTE_S = 60;

const path = (kind, d) => shape("path", { class: kind, d });

// Return the running mean and standard deviation at each stride; null before the second valid one.
export function runningMeans(values) {
  let [count, mean, squares] = [0, 0, 0]; // Welford's
  return values.map((value) => {
    if (value != null) {
      count += 1;
      const off = value - mean;
      mean += off / count;
      squares += off * (value - mean);
    }
    return count < 2 ? null : { mean, sd: Math.sqrt(squares / (count - 1)) };
  });
}

// Return what gives a stride's performance; one from before there was a goal has that of the first goal.
export function performanceOf(strides, { goal, higher_is_better: isHigherBetter }) {
  const first = strides.find((stride) => stride.goal != null)?.goal ?? goal;
  return ({ performance, valid, value, gain }) => {
    if (performance != null) return performance;
    if (!valid || value == null || first === null) return null;
    return isHigherBetter ? (gain * value) / first : first / (gain * value);
  };
}

// Return what is plotted: [lowest, highest], the value of a stride, and the lines of the scale.
function scaleOf(shown, strides, session) {
  const { goal, unit, span } = session;
  if (goal !== null || shown.some(({ performance }) => performance != null)) {
    const range = [1 - span / 2, 1 + span / 2]; // performance
    const lines = [range[0], 1, range[1]].map((share) => [share, percent(share)]);
    return { range, isJudged: true, valueOf: performanceOf(strides, session), lines };
  }
  const valueOf = ({ valid, value }) => (valid ? (value ?? null) : null);
  const values = shown.map(valueOf).filter((value) => value !== null);
  const highest = Math.max(0, ...values);
  if (!highest) return { range: [0, 1], isJudged: false, valueOf, lines: [] };
  const bottom = span < 1 ? Math.min(...values, (1 - span / 2) * highest) : 0;
  const room = highest - bottom;
  const size = 10 ** Math.floor(Math.log10(room / 2));
  const step = [1, 2, 5, 10].map((n) => n * size).find((one) => room / one <= 4);
  const [low, top] = [step * Math.floor(bottom / step), step * Math.ceil(highest / step)];
  const places = Math.max(0, -Math.floor(Math.log10(step)));
  const count = Math.round((top - low) / step);
  const lines = Array.from({ length: count + 1 }, (_each, n) => [
    low + n * step,
    number(low + n * step, places) + (n === count ? ` ${unit}` : ""),
  ]);
  return { range: [low, top], isJudged: false, valueOf, lines };
}

export function drawStrip(svg, strides, annotations, session) {
  const [width, height] = fitViewBox(svg);
  const shown = strides.slice(-Math.max(20, Math.floor((width - 70) / SPACING)));
  const dx = (width - 70) / Math.max(shown.length - 1, FEWEST);
  const starts = [...shown.keys()].filter(
    (index) => index && shown[index].phase !== undefined && shown[index].phase !== shown[index - 1].phase,
  );
  const top = starts.length ? HEAD + NAMES : annotations.length ? HEAD : 10;
  const floor = height - AXIS;
  const { range, isJudged, valueOf, lines } = scaleOf(shown, strides, session);
  const x = (index) => 56 + index * dx;
  const y = (value) => {
    const inside = Math.min(Math.max(value, range[0]), range[1]);
    return floor - LANE - ((inside - range[0]) * (floor - top - LANE)) / (range[1] - range[0]);
  };

  function drawScale() {
    const labels = lines.map(([value, label]) => text(label, { x: 0, y: y(value) + 4 }));
    if (!isJudged) return [...labels, ...drawMeans()];
    const size = { x: 50, y: y(range[1]), width: width - 50, height: Math.max(0, y(1) - y(range[1])) };
    return [shape("rect", { class: "above", ...size }), ...labels, path("goal", `M50 ${y(1)}H${width}`)];
  }

  function drawMeans() {
    const means = runningMeans(shown.map(valueOf));
    const known = [...means.keys()].filter((index) => means[index]);
    if (!known.length) return [];
    const line = (at) => known.map((index) => `${x(index)} ${y(at(means[index]))}`);
    const upper = line(({ mean, sd }) => mean + sd);
    const lower = line(({ mean, sd }) => mean - sd).reverse();
    return [
      path("spread", `M${[...upper, ...lower].join("L")}Z`),
      path("mean", `M${line(({ mean }) => mean).join("L")}`),
    ];
  }

  function drawStride(stride, index) {
    const value = valueOf(stride);
    if (value == null) return path("gap", `M${x(index)} ${floor - 4}v-10`);
    const kind = stride.performance == null ? "calm" : stride.close ? "close" : stride.hit ? "hit" : "miss";
    if (value > range[1]) return path(kind, `M${x(index)} ${y(range[1]) - 5}l5 9h-10z`);
    if (value < range[0]) return path(kind, `M${x(index)} ${y(range[0]) + 5}l5 -9h-10z`);
    return shape("circle", { class: kind, cx: x(index), cy: y(value), r: index === shown.length - 1 ? 6 : 3.2 });
  }

  function drawPhases() {
    return starts.map((index, n) => {
      const left = x(index) - dx / 2;
      const room = (n + 1 < starts.length ? x(starts[n + 1]) : width) - left;
      const name = phaseName(session.phases[shown[index].phase]?.name ?? "");
      const label = room < LETTER * name.length ? "" : text(name, { class: "part", x: left + 5, y: 40 });
      return path("bound", `M${left} 24V${floor}`) + label;
    });
  }

  // The minutes before the newest stride, by the source's clock.
  function drawMinutes() {
    if (!shown.length) return [];
    const now = shown.at(-1).time_s;
    const newest = x(shown.length - 1);
    const marks = [text(_("now"), { class: "minute", x: Math.min(newest, width - 22), y: height - 3 })];
    let free = newest - 40;
    for (let minutes = 1; minutes * MINUTE_S <= now - shown[0].time_s; minutes++) {
      const at = x(shown.findIndex(({ time_s }) => time_s >= now - minutes * MINUTE_S));
      if (at > free) continue;
      free = at - 44;
      const label = text(`${number(-minutes)} min`, { class: "minute", x: at, y: height - 3 });
      marks.push(path("bound", `M${at} ${floor}v4`) + label);
    }
    return marks;
  }

  const place = { width, floor, dx, x };
  svg.innerHTML = [
    ...drawScale(),
    ...shown.map(drawStride),
    ...drawPhases(),
    ...drawMinutes(),
    ...drawAnnotations(shown, annotations, place),
  ].join("");
}
