// One session: every stride against the goal, phases behind it, what was changed above it.
import { _, fill, number } from "garry/shared/language";
import { reasonName } from "garry/shared/labels";
import { color, draw, isNarrow, paths } from "garry/charts/chart";

const data = document.getElementById("session");
const { strides, phases, marks: changes, unit } = data ? JSON.parse(data.textContent) : {};
const DENSE_PX = 2; // a stride; with less they are drawn smaller

// Values of the strides with a verdict: true for hits, false for misses, null without one. Those that
// were close are drawn by themselves.
function valuesOf(verdict) {
  return strides.value.map((value, i) => (strides.hit[i] === verdict && !strides.close[i] ? value : null));
}

function describeVerdict(index) {
  if (strides.value[index] === null)
    return fill(_("does not count (%(why)s)"), {
      why: strides.why[index] ? strides.why[index].split(", ").map(reasonName).join(", ") : _("no value"),
    });
  if (strides.hit[index] === null) return _("no goal yet");
  const side = strides.hit[index] ? _("hit") : _("below the goal");
  return strides.close[index] ? fill(_("close: %(side)s"), { side }) : side;
}

function formatValue(value) {
  return value === null ? "–" : `${number(value, 2)} ${unit}`;
}

function showReadout(index) {
  if (index === null || index === undefined) return;
  const goal =
    strides.goal[index] === null ? "" : fill(_(", goal %(goal)s"), { goal: formatValue(strides.goal[index]) });
  document.querySelector(".readout").textContent = fill(_("Stride %(number)s: %(value)s, %(verdict)s"), {
    number: strides.number[index],
    value: formatValue(strides.value[index]) + goal,
    verdict: describeVerdict(index),
  });
}

function pointSeries(size, width, stroke, fill) {
  const [ring, inside] = [() => color(stroke), () => color(fill)];
  return { paths: () => null, points: { show: true, size, width, stroke: ring, fill: inside, space: 0 } };
}

function placePhases(marks) {
  const { box } = marks;
  const placed = phases.map((phase) => {
    const left = Math.max(box.left, marks.x(phase.from - 0.5));
    const right = Math.min(box.left + box.width, marks.x(phase.to + 0.5));
    return { phase, left, right, isWide: marks.widthOf(phase.name) < right - left - 12 * marks.unit };
  });
  return placed.filter(({ left, right }) => right > left);
}

function drawPhases(marks) {
  const { ctx, box } = marks;
  for (const { phase, left, right, isWide } of placePhases(marks)) {
    ctx.fillStyle = color(phase.feedback ? "card" : "well");
    ctx.fillRect(left, box.top, right - left, box.height);
    marks.line(left, 12 * marks.unit, left, box.top + box.height, color("border"), 1);
    if (isWide) {
      const fill = color("text");
      const from = { align: "left", weight: 700, fill };
      marks.text(phase.name, left + 7 * marks.unit, 26 * marks.unit, from);
    }
  }
}

// The names of narrow phases, readable over what is drawn there.
function drawUprightNames(marks) {
  const { box, unit: pixel } = marks;
  for (const { phase, left, right, isWide } of placePhases(marks)) {
    if (isWide || right - left <= 18 * pixel) continue;
    marks.upright(phase.name, left + 5 * pixel, box.top, color(phase.feedback ? "card" : "well"));
  }
}

// Return one label for all that was changed after a stride: its words, or where these have no room its number.
function groupChanges(numbered) {
  const groups = new Map();
  for (const { after, kind, words } of changes) {
    const group = groups.get(after) ?? { after, isGoal: false, isPain: false, words: [] };
    group.isGoal ||= kind === "goal";
    group.isPain ||= kind === "pain";
    group.words.push(words);
    groups.set(after, group);
  }
  return [...groups.values()].map((group, index) => {
    const words = group.words.join(" · ");
    return { ...group, words, label: numbered ? `${index + 1}` : words };
  });
}

function drawChanges(marks, groups) {
  const { box, unit: pixel } = marks;
  const free = [box.left, box.left]; // labels never run into each other: two rows of them
  const labels = [];
  for (const [index, { after, isGoal, isPain, label }] of groups.entries()) {
    const x = marks.x(after + 0.5);
    if (x < box.left || x > box.left + box.width) continue;
    const fill = color(isGoal ? "c-goal" : isPain ? "error" : "c-third");
    const wide = marks.widthOf(label, 13);
    const start = Math.min(x + 5 * pixel, box.left + box.width - wide);
    const next = index + 1 < groups.length ? marks.x(groups[index + 1].after + 0.5) : Infinity;
    const rows = next < start + wide ? [1, 0] : [0, 1]; // over the line of the next, if that would cross it
    const row = rows.find((each) => start >= free[each]) ?? -1;
    const foot = box.top - (row === 1 ? 28 : 8) * pixel;
    marks.line(x, foot, x, box.top + box.height, fill, isGoal ? 2 : 1.5, isGoal ? [] : [5, 4]);
    if (row < 0) continue;
    labels.push({ label, start, wide, foot, fill });
    free[row] = start + wide + 10 * pixel;
  }
  // Over the lines of the row above.
  for (const { label, start, wide, foot, fill } of labels) {
    marks.ctx.fillStyle = color("card");
    marks.ctx.fillRect(start - 2 * pixel, foot - 15 * pixel, wide + 4 * pixel, 16 * pixel);
    marks.text(label, start, foot - 3 * pixel, { size: 13, weight: 700, align: "left", fill });
  }
}

function cell(tag, text) {
  const made = document.createElement(tag);
  made.textContent = text;
  return made;
}

function listChanges(groups) {
  const list = document.createElement("ol");
  list.className = "key";
  for (const { label, words } of groups) {
    const entry = cell("li", ` ${words}`);
    entry.prepend(cell("b", label));
    list.append(entry);
  }
  return list;
}

function drawGaps(marks) {
  const bottom = marks.box.top + marks.box.height;
  strides.value.forEach((value, index) => {
    if (value !== null) return;
    const x = marks.x(strides.number[index]);
    if (x >= marks.box.left && x <= marks.box.left + marks.box.width) {
      marks.line(x, bottom - 12 * marks.unit, x, bottom, color("c-gap"), 2);
    }
  });
}

function drawStrides(element) {
  const seen = [...strides.value, ...strides.goal].filter((value) => value !== null);
  const [least, most] = [Math.min(...seen), Math.max(...seen, 0.001)];
  const air = 0.06 * (most - Math.min(least, 0.9 * most));
  const bottom = least > 0.3 * most ? least - 2 * air : Math.min(0, least); // what lies far above zero fills the page
  const narrow = isNarrow(element);
  const isDense = element.clientWidth / strides.number.length < DENSE_PX;
  const [size, width] = isDense ? (narrow ? [4, 1] : [5, 1.5]) : [8, 2];
  const groups = groupChanges(narrow);
  if (narrow && groups.length) element.before(listChanges(groups));
  draw(element, {
    data: [
      strides.number,
      valuesOf(null),
      valuesOf(false),
      valuesOf(true),
      strides.value.map((value, i) => (strides.close[i] ? value : null)),
      strides.goal,
    ],
    series: [
      { paths: () => null, points: { show: false } },
      pointSeries(size, width, "c-miss", "card"),
      pointSeries(size, width, "c-hit", "c-hit"),
      pointSeries(0.6 * size, width, "c-third", "c-third"),
      { stroke: () => color("c-goal"), width: 2.5, paths: paths.stepped({ align: 1 }), points: { show: false } },
    ],
    scales: { x: { time: false }, y: { range: () => [bottom, most + air] } },
    padding: [76, narrow ? 6 : 26, 0, 0],
    cursor: { y: false, points: { show: false }, drag: { x: true, y: false } },
    under: drawPhases,
    paint: (marks) => {
      strides.value.forEach((value, index) => {
        if (value === null || strides.hit[index] !== null) return;
        const x = marks.x(strides.number[index]);
        if (x >= marks.box.left && x <= marks.box.left + marks.box.width) {
          marks.square(strides.number[index], value, size / 2.6, color("c-third"));
        }
      });
      marks.text(unit, 0, marks.box.top - 11 * marks.unit, { align: "left" });
      marks.text(_("Stride"), 0, marks.box.top + marks.box.height + 22 * marks.unit, { align: "left" });
      drawGaps(marks);
      drawChanges(marks, groups);
      drawUprightNames(marks);
    },
    onCursor: showReadout,
    yAxis: { values: (_, ticks) => ticks.map((tick) => number(tick, 1)), space: 44 },
    xAxis: { space: 70 },
  });
}

// Thousands of rows are only made when somebody opens them.
function fillTable(place) {
  const table = document.createElement("table");
  const head = table.createTHead().insertRow();
  for (const name of [
    _("Stride"),
    fill(_("Measured, %(unit)s"), { unit }),
    fill(_("Goal, %(unit)s"), { unit }),
    _("Verdict"),
  ]) {
    const title = cell("th", name);
    title.scope = "col";
    head.append(title);
  }
  const body = table.createTBody();
  strides.number.forEach((stride, index) => {
    const row = body.insertRow();
    const title = cell("th", stride);
    title.scope = "row";
    const value = (column) => (strides[column][index] === null ? "–" : number(strides[column][index], 2));
    row.append(title, cell("td", value("value")), cell("td", value("goal")), cell("td", describeVerdict(index)));
  });
  place.append(table);
}

if (strides) {
  drawStrides(document.querySelector(".chart"));
  const place = document.querySelector(".strides");
  const details = place.closest("details");
  details.addEventListener("toggle", () => {
    if (details.open && !place.hasChildNodes()) fillTable(place);
  });
}
