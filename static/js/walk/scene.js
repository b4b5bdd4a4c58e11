// The thermometer and the latest strides. Everything is drawn once for each frame (fit_layout.js) and then only moved,
// so a step costs a handful of attributes.

import { append } from "garry/shared/svg_element";
import { createDots } from "garry/walk/stride_dots";

const TOP = 1.5; // the scale's end; the goal is always at two thirds of it. The glass may go on.
const TUBE_RADIUS = 68;
const BULB_RADIUS = 88;
const [BULB_HIGH, BADGE_HIGH] = [94, 104]; // its middle, above the thermometer's foot; the badge's in its place
// The least gap between a step and the goal line, in the thermometer and in the chart: seen from 2 m.
const [CLEAR, CLEAR_IN_CHART] = [44, 26];
const TICKS = [0.25, 0.5, 0.75, 1.25];
// The goal's sign: it points at the line, behind or before the thermometer, or stands on the horizon before it.
// Its tip alone is where words name the goal, or opposite the sign (layouts.css).
const AT_LINE = "M0 0l20 -40h148v80h-148z";
const ON_LINE = "M0 40l20 -80h148v80z";
const SIGN_WIDE = 184; // with air
const SIGNS = {
  behind: { path: AT_LINE, rise: 0, turn: 1 },
  beside: { path: AT_LINE, rise: 0, turn: -1 },
  before: { path: ON_LINE, rise: 43, turn: -1 },
};

export function createScene(svg) {
  const find = (selector) => svg.querySelector(selector);
  const thermometer = find(".thermometer");
  const liquid = find(".liquid");
  const ticks = TICKS.map(() => append(find(".ticks"), "path"));
  const dots = createDots(svg);
  let layout, shown;

  const onScale = (performance) => layout.zero - ((layout.zero - layout.top) * Math.max(performance, 0)) / TOP;
  const y = (performance) => Math.max(onScale(performance), layout.full);

  // Place all: `top`, `zero` and `goal` are heights of the scale, `full` where the glass ends, `reach` that of the
  // strides about the goal.
  function layOut(frame) {
    layout = frame;
    const {
      width,
      height,
      full,
      zero,
      goal,
      reach,
      sign,
      signSize,
      tipTurn,
      isFlipped,
      axis: x,
      isBadgeBulb,
      stand,
      thick,
    } = frame;
    const { path, rise, turn } = SIGNS[sign];
    const [r, bulbRadius] = [TUBE_RADIUS * thick, BULB_RADIUS * thick];
    const [top, bottom] = [full - 36, stand - (isBadgeBulb ? BADGE_HIGH : BULB_HIGH * thick)];
    const join = bottom - Math.sqrt(bulbRadius ** 2 - r ** 2);
    const tube = `M${-r} ${join}V${top + r}A${r} ${r} 0 0 1 ${r} ${top + r}V${join}`;
    const bulb = isBadgeBulb ? `V${bottom}H${-r}Z` : `A${bulbRadius} ${bulbRadius} 0 1 1 ${-r} ${join}Z`;
    const shell = tube + bulb;
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    for (const path of svg.querySelectorAll(".shell")) path.setAttribute("d", shell);
    find(".glass").setAttribute("transform", `translate(${x} 0)`);
    place(".hatched", 0, top, { height: zero - top });
    place(".bulb", 0, bottom, { r: bulbRadius });
    place(".cut", 0, zero - 14);
    place(".foot", 0, bottom, {}, `${isFlipped ? " scale(-1 1)" : ""} rotate(14) scale(1.08)`);
    place(".pennant", turn * (r + 14), goal - rise * signSize, {}, ` scale(${turn * signSize} ${signSize})`);
    place(".tip", tipTurn * (r + 14), goal, {}, ` scale(${tipTurn * signSize} ${signSize})`);
    find(".pennant path").setAttribute("d", path);
    const isTurned = isFlipped === turn > 0; // by the sign or by the scene, not by both
    find(".pennant text").setAttribute("transform", isTurned ? "translate(182 0) scale(-1 1)" : "");
    place(".sparkles", 0, top);
    for (const line of svg.querySelectorAll(".goal")) line.setAttribute("transform", `translate(0 ${goal})`);
    ticks.forEach((tick, i) => tick.setAttribute("d", `M${r - 3} ${y(TICKS[i])}h${TICKS[i] === 0.5 ? -32 : -20}`));
    const end = x - r - 50 - (turn > 0 ? 0 : SIGN_WIDE);
    const swing = reach - 30; // of the middle of a dot
    dots.layOut({
      left: 60,
      right: end,
      y: (stride) => Math.min(Math.max(levelOf(stride, CLEAR_IN_CHART), goal - swing), goal + swing),
      beyond: (performance) => Math.sign(Math.trunc((y(performance) - goal) / (swing + 1))),
    });
    if (shown) show(shown);
  }

  function place(selector, x, y, attributes = {}, more = "") {
    const element = find(selector);
    element.setAttribute("transform", `translate(${x} ${y})${more}`);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  }

  // Return how high a step stands: plainly below the goal line if it missed, above it if it hit. The scale goes on from
  // there to the same ends, so that a better step is always higher.
  function levelOf({ performance, hit, close }, clear) {
    const level = y(performance ?? 0);
    if (performance == null || close) return level;
    const [side, room] = hit ? [-1, layout.goal - layout.full] : [1, layout.zero - layout.goal];
    return layout.goal + side * (clear + (1 - clear / room) * Math.max(side * (level - layout.goal), 0));
  }

  // Show the last step's performance (null: not measured; undefined: none yet) and the strides.
  // `isCut`: whether the scale begins above 0.
  function show(step) {
    shown = step;
    const { performance, hit, close, strides: entries, isCut } = step;
    if (!layout) return; // no room for it
    thermometer.toggleAttribute("data-cut", isCut);
    const level = levelOf(shown, CLEAR);
    const height = performance === null ? layout.zero + 60 : level;
    liquid.style.transform = `translateY(${height}px)`;
    ticks.forEach((tick, i) => tick.classList.toggle("wet", performance !== null && y(TICKS[i]) > level));
    thermometer.dataset.hit = hit && !close ? "yes" : "no";
    thermometer.toggleAttribute("data-missing", performance === null);
    thermometer.toggleAttribute("data-over", onScale(performance) < layout.full);
    dots.draw(entries);
  }

  return { show, layOut };
}
