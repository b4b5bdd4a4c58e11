// The landscape: horizon, thermometer and figures. Everything is drawn once for each orientation and
// then only moved, so a step costs a handful of attributes.

import { append } from "garry/shared/svg";
import { createDots } from "garry/walk/stride_dots";

const TOP = 1.5; // the scale's end; the goal is always at two thirds of it
const TUBE_RADIUS = 68;
const BULB_RADIUS = 94;
const TICKS = [0.25, 0.5, 0.75, 1.25];
const LEAST = 280; // of the scale's height, with its horizon between words and number
const AIR = 20; // between words and horizon
const TALLEST = 150; // the scale's top where words stand beside it
// `under`: whether words stand over the thermometer, not beside it.
const LAYOUTS = {
  portrait: {
    wide: 800,
    high: 1280,
    x: 570,
    y150: 484,
    y0: 1068,
    under: true,
    chart: [60, 446],
    figure: [400, 930, 1.66],
  },
  landscape: {
    wide: 1280,
    high: 800,
    x: 1048,
    y150: 330,
    y0: 612,
    under: false,
    chart: [440, 912],
    figure: [900, 560, 1.36],
  },
  column: {
    wide: 800,
    high: 1000,
    x: 570,
    y150: 456,
    y0: 812,
    under: true,
    chart: [60, 446],
    figure: [400, 760, 1.06],
  },
  center: { wide: 900, high: 900, x: 644, y150: 400, y0: 712, under: true, chart: [60, 446], figure: [450, 660, 1.06] },
};

export function createScene(svg) {
  const find = (selector) => svg.querySelector(selector);
  const stage = svg.parentElement;
  const thermometer = find(".thermometer");
  const liquids = svg.querySelectorAll(".liquid");
  const arrow = find(".way");
  const ticks = TICKS.map(() => append(find(".ticks"), "path"));
  const dots = createDots(svg);
  const portrait = matchMedia("(orientation: portrait)");
  let layout, shown;

  const y = (performance) => layout.y0 - ((layout.y0 - layout.y150) * Math.min(Math.max(performance, 0), TOP)) / TOP;

  // Place all for the screen's shape, and for how much of the scene has gone (fit_layout.js); `sky`: between which
  // heights the horizon may lie once words are large.
  function layOut(dropped = 0, sky = null) {
    const { column, side } = document.body.dataset;
    const isCenter = column === "center" && !portrait.matches;
    const shape = isCenter ? "center" : column ? "column" : portrait.matches ? "portrait" : "landscape";
    layout = { ...LAYOUTS[shape] };
    const { x, y0, wide, high, under, figure } = layout;
    const box = `0 0 ${wide} ${high}`;
    const [words, number] = (sky ?? [0, 1]).map((share) => share * high);
    if (under && sky) layout.y150 = Math.min(words + 56, y0 - LEAST / 2);
    else if (sky) layout.y150 = Math.max(TALLEST, (3 * (words + AIR) - y0) / 2);
    if (sky && !under && y0 - layout.y150 < LEAST) layout.y150 = TALLEST;
    const { y150 } = layout;
    const [goal, top, bottom] = [y(1), y150 - 36, y0 + 78];
    const horizon = dropped > 2 ? (words + number) / 2 : goal;
    const crosses = sky && (horizon < words || horizon > number);
    const join = bottom - Math.sqrt(BULB_RADIUS ** 2 - TUBE_RADIUS ** 2);
    const r = TUBE_RADIUS;
    const tube = `M${-r} ${join}V${top + r}A${r} ${r} 0 0 1 ${r} ${top + r}V${join}`;
    const shell = `${tube}A${BULB_RADIUS} ${BULB_RADIUS} 0 1 1 ${-r} ${join}Z`;
    for (const drawing of [svg, stage.querySelector(".backdrop")]) drawing.setAttribute("viewBox", box);
    stage.style.setProperty("--goal", `${crosses ? high + 100 : horizon}px`);
    for (const path of svg.querySelectorAll(".shell")) path.setAttribute("d", shell);
    find(".glass").setAttribute("transform", `translate(${x} 0)`);
    find(".above").setAttribute("height", goal - 3);
    place(".hatched", 0, top, { height: y0 - top });
    place(".shined", 0, top, { height: y0 - top - 8 });
    place(".bulb", 0, bottom);
    place(".cut", 0, y0 - 14);
    place(".foot", 0, bottom, {}, `${side === "left" ? " scale(-1 1)" : ""} rotate(14) scale(1.08)`);
    place(".pennant", TUBE_RADIUS + 10, goal);
    place(".sparkles", 0, top);
    for (const line of svg.querySelectorAll(".goal")) line.setAttribute("transform", `translate(0 ${goal})`);
    ticks.forEach((tick, i) =>
      tick.setAttribute("d", `M${TUBE_RADIUS - 3} ${y(TICKS[i])}h${TICKS[i] === 0.5 ? -32 : -20}`),
    );
    place(".figures", figure[0], figure[1], {}, ` scale(${figure[2]})`);
    dots.layOut({ chart: layout.chart, end: x - TUBE_RADIUS - 6, y });
    if (shown) show(shown);
  }

  function place(selector, x, y, attributes = {}, more = "") {
    const element = find(selector);
    element.setAttribute("transform", `translate(${x} ${y})${more}`);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  }

  // Show the last step's performance (null: not measured; undefined: none yet) and the strides.
  // `isCut`: whether the scale begins above 0.
  function show({ performance, hit, close, strides: entries, isCut }) {
    shown = { performance, hit, close, strides: entries, isCut };
    thermometer.toggleAttribute("data-cut", isCut);
    const level = y(performance ?? 0);
    const height = performance === null ? layout.y0 + 60 : level;
    for (const liquid of liquids) liquid.style.transform = `translateY(${height}px)`;
    ticks.forEach((tick, i) => tick.classList.toggle("wet", performance !== null && y(TICKS[i]) > level));
    const goesOn = performance > 0 && !hit && !close && level - 20 > y(1) + 14;
    arrow.setAttribute("d", goesOn ? `M0 ${level - 20}V${y(1) + 14}` : "");
    thermometer.dataset.hit = hit && !close ? "yes" : "no";
    thermometer.toggleAttribute("data-missing", performance === null);
    thermometer.toggleAttribute("data-over", performance > TOP);
    dots.draw(entries);
  }

  layOut();
  return { show, layOut };
}
