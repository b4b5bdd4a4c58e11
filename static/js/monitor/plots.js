// Drawings of strides against the goal for the PT: a strip, the last twenty, the share of hits.
// Shape repeats the meaning of color: hits are solid, misses hollow, missing ones hatched.

import { number } from "garry/shared/language";
import { badge, isRemark, say } from "garry/monitor/annotations";
import { phaseName } from "garry/shared/labels";

const LOW = 0.5,
  HIGH = 1.5;

function sizeOf(svg) {
  const { width, height } = svg.getBoundingClientRect();
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  return [width, height];
}

export function drawStrip(svg, strides, marks, phases) {
  const [width, height] = sizeOf(svg);
  const y = (share) => height - 8 - ((Math.min(Math.max(share, LOW), HIGH) - LOW) * (height - 34)) / (HIGH - LOW);
  const shown = strides.slice(-Math.max(20, Math.floor((width - 60) / 4)));
  const dx = (width - 60) / Math.max(shown.length - 1, 60);
  const x = (index) => 46 + index * dx;
  let drawing = `<rect class="above" x="40" y="${y(HIGH)}" width="${width - 40}" height="${y(1) - y(HIGH)}"/>`;
  for (const share of [0.5, 1, 1.5]) drawing += `<text x="0" y="${y(share) + 5}">${number(share * 100)} %</text>`;
  drawing += `<path class="goal" d="M40 ${y(1)}H${width}"/>`;
  shown.forEach(({ performance, hit, valid }, index) => {
    const newest = index === shown.length - 1;
    if (valid && (performance === null || performance === undefined))
      drawing += `<circle class="calm" cx="${x(index)}" cy="${height - 10}" r="3.2"/>`;
    else if (performance === null || performance === undefined)
      drawing += `<path class="gap" d="M${x(index)} ${height - 8}v-10"/>`;
    else
      drawing += `<circle class="${hit ? "hit" : "miss"}" cx="${x(index)}" cy="${y(performance)}" r="${newest ? 6 : 3.2}"/>`;
  });
  const parts = []; // names that somebody typed: set as text, never as markup
  const bounds = shown.flatMap(({ phase }, index) =>
    index && phase !== undefined && phase !== shown[index - 1].phase ? [index] : [],
  );
  bounds.forEach((index, n) => {
    const at = x(index) - dx / 2,
      name = phaseName(phases[shown[index].phase]?.name ?? "");
    drawing += `<path class="bound" d="M${at} 4V${height - 8}"/>`;
    const room = (n + 1 < bounds.length ? x(bounds[n + 1]) : width) - at;
    if (room < 8 * name.length) return;
    drawing += `<text class="part" x="${at + 5}" y="40"></text>`;
    parts.push(name);
  });
  let level = 0,
    before = null; // what was noted at the same stride stands above each other
  let free = 0; // badges and flags stand in a row on top and never cover each other
  for (const mark of marks) {
    const { after, kind, value } = mark;
    if (!shown.length || after < shown[0].number) continue;
    const next = shown.findIndex(({ number }) => number > after);
    const at = next < 0 ? x(shown.length) : x(next) - dx / 2;
    if (kind === "goal") {
      if (value === null) continue;
      const cloth = Math.min(Math.max(at, free), width - 56);
      free = cloth + 57;
      drawing += `<path class="flag" d="M${at} 4V${height - 8}"/><path class="cloth" d="M${cloth} 2h54v20h-54z"/><text class="on-cloth" x="${cloth + 27}" y="17">${number(value, 2)}</text>`;
      continue;
    }
    if (!isRemark(mark)) {
      const place = Math.min(Math.max(at, free + 9), width - 10);
      free = place + 11;
      drawing += `<g class="change"><title>${say(mark)}</title><path class="flag" d="M${at} 21V${height - 8}"/><circle cx="${place}" cy="12" r="9"/><text x="${place}" y="16">${badge(mark)}</text></g>`;
    } else {
      level = after === before ? level + 1 : 0;
      before = after;
      const words = say(mark);
      drawing += `<path class="remark" d="M${at} ${height - 4}l-6 -9h12z"/><text class="remark-words" x="${Math.min(Math.max(at, 80), width - 40)}" y="${height - 16 - 13 * level}">${words}</text>`;
    }
  }
  svg.innerHTML = drawing;
  svg.querySelectorAll(".part").forEach((part, index) => (part.textContent = parts[index]));
}

export function drawTwenty(svg, strides) {
  const [width, height] = sizeOf(svg);
  const middle = height * 0.55,
    scale = height * 0.95,
    dx = width / 20;
  let drawing =
    '<defs><pattern id="hatch" width="7" height="7" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><path class="gap" d="M0 0V7"/></pattern></defs>';
  strides.forEach(({ performance, hit, valid }, index) => {
    const left = (20 - strides.length + index) * dx + dx * 0.16,
      wide = dx * 0.68;
    if (valid && (performance === null || performance === undefined)) {
      drawing += `<circle class="calm" cx="${left + wide / 2}" cy="${middle}" r="5"/>`;
      return;
    }
    if (performance === null || performance === undefined) {
      drawing += `<rect x="${left}" y="${middle - 22}" width="${wide}" height="44" rx="4" fill="url(#hatch)"/>`;
      return;
    }
    const size = Math.min(Math.max(4, Math.abs(performance - 1) * scale), middle - 22);
    if (hit) drawing += `<rect class="hit" x="${left}" y="${middle - size}" width="${wide}" height="${size}" rx="4"/>`;
    else
      drawing += `<rect class="miss" x="${left + 1.5}" y="${middle}" width="${wide - 3}" height="${Math.min(size, height - middle - 4)}" rx="4"/>`;
    if (index === strides.length - 1)
      drawing += `<text class="newest" x="${left + wide}" y="${hit ? middle - size - 8 : Math.min(middle + size + 17, height - 4)}">${number(100 * performance)}</text>`;
  });
  svg.innerHTML = drawing + `<path class="goal" d="M0 ${middle}H${width}"/>`;
}

export function drawRing(svg, rate, wanted) {
  const around = 2 * Math.PI * 62;
  const arc =
    rate === null || rate === undefined
      ? ""
      : `<circle class="arc" cx="80" cy="80" r="62" stroke-dasharray="${around * rate} ${around}" transform="rotate(-90 80 80)"/>`;
  const tick = wanted
    ? `<g transform="rotate(${wanted * 360} 80 80)"><path class="tick-edge" d="M80 4v28"/><path class="tick" d="M80 2v32"/></g>`
    : "";
  svg.innerHTML = `<circle class="track" cx="80" cy="80" r="62"/>${arc}${tick}<text class="rate" x="80" y="80" dy=".36em">${arc ? `${number(100 * rate)} %` : "–"}</text>`;
}
