// The steps of a gesture as places on the floor: tap to go there, drag to change. The numbers in the table below
// follow, and what is shown comes from the server, which simulates each change (or says what is wrong with it).

import { playPreview } from "garry/shared/gesture_preview";
import { append } from "garry/shared/svg_element";
import { RobotScene } from "garry/shared/robot_scene";
import { WalkerView } from "garry/shared/walker_view";

const PAUSE_MS = 250; // after the last change, before the server is asked
const STRAIGHT_RAD = 0.02; // what still counts as straight back
const NEAR_M = 0.15; // a gesture that stays within it is drawn twice as large
const AHEAD_M = 0.45; // of the drawing, the least there is to a side
// Sizes in pixels of the screen
const SPOT = 18; // of a number, from its middle
const APART = 40; // between two numbers
// Where else a number may stand, in steps of that: a few behind its place, then beside, last ahead.
const STEPS = [-4, -3, -2, -1, 0, 1, 2, 3, 4];
const OFFSETS = STEPS.flatMap((behind) =>
  STEPS.map((beside) => ({ behind, beside, far: Math.hypot((behind > 0 ? 0.4 : 2) * behind, beside) })),
).sort((one, other) => one.far - other.far);
const KNOB = 48; // from a place to the knob that turns it
const NAMES = ["turn_deg", "forward_m", "hold_s", "pace", "within_s"];
const TRACKS = ["lights", "notes"]; // fields beside the steps
const HOME = { x: 0, y: 0, heading: 0 };

const degrees = (radians) => (radians * 180) / Math.PI;
const radians = (deg) => (deg * Math.PI) / 180;
const between = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle)); // in ±π

// Return where each step ends: place [m] and heading [rad], seen from home.
export function posesOf(steps) {
  let here = HOME;
  return steps.map(({ turn_deg, forward_m }) => {
    const heading = here.heading + radians(turn_deg);
    const [x, y] = [here.x + forward_m * Math.cos(heading), here.y + forward_m * Math.sin(heading)];
    here = { x, y, heading, isDrive: forward_m !== 0 };
    return here;
  });
}

// Return the turn and the way that lead from one pose to a place: ahead, since a base has no bumper behind, or straight
// back the way it came.
export function moveTo(from, { x, y }) {
  const way = Math.hypot(x - from.x, y - from.y);
  if (way < 0.01) return { turn_deg: 0, forward_m: 0 };
  const turn = between(Math.atan2(y - from.y, x - from.x) - from.heading);
  const isBack = Math.abs(turn) > Math.PI - STRAIGHT_RAD;
  return rounded(isBack ? between(turn + Math.PI) : turn, isBack ? -way : way);
}

const rounded = (turn, way) => ({
  turn_deg: Math.round(10 * degrees(turn)) / 10,
  forward_m: Math.round(1000 * way) / 1000,
});

// Return where the numbers of poses are drawn: at their places, or near those that stand there already, within a
// distance from home ahead and beside.
export function spotsOf(poses, apart_m, within_m) {
  const spots = [];
  const isFree = (spot) =>
    Math.max(Math.abs(spot.x), Math.abs(spot.y)) <= within_m &&
    spots.every((one) => Math.hypot(one.x - spot.x, one.y - spot.y) >= apart_m - 1e-6);
  for (const { x, y } of poses) {
    const near = OFFSETS.map(({ behind, beside }) => ({ x: x - behind * apart_m, y: y - beside * apart_m }));
    spots.push(near.find(isFree) ?? { x, y });
  }
  return spots;
}

// The rows of Django's table that hold a step.
class Rows {
  constructor(form) {
    this.form = form;
  }

  get all() {
    const rows = this.form.querySelectorAll("#steps-group tr.form-row:not(.empty-form)");
    return [...rows].filter((row) => !row.querySelector("[name$=-DELETE]")?.checked);
  }

  get used() {
    return this.all.filter((row) => ["turn_deg", "forward_m", "hold_s"].some((name) => this.number(row, name)));
  }

  field = (row, name) => row.querySelector(`[name$=-${name}]`);

  number = (row, name) => Number(this.field(row, name).value) || 0;

  read() {
    return this.used.map((row) =>
      Object.fromEntries(NAMES.map((name) => [name, name === "within_s" ? this.limit(row) : this.number(row, name)])),
    );
  }

  limit = (row) => this.number(row, "within_s") || null;

  write(row, values) {
    for (const [name, value] of Object.entries(values)) this.field(row, name).value = value;
  }

  add(values) {
    const used = this.used;
    let row = this.all.find((one) => !used.includes(one));
    if (!row) {
      this.form.querySelector("#steps-group .add-row a").click();
      row = this.all.at(-1);
    }
    this.write(row, values);
  }
}

export function setUpFloor(place) {
  const form = place.closest("form");
  const rows = new Rows(form);
  const [svg, film] = place.querySelectorAll("svg");
  const [words, problem, play] = [".words", ".errornote", "[data-play]"].map((one) => place.querySelector(one));
  const scene = new RobotScene(svg, { isFollowed: false });
  const walker = new WalkerView(film);
  const handles = append(svg, "g");
  const reach = Number(place.dataset.reach);
  let preview, timer, dragged, audio;

  const knobAt = (isDrive, x, y, r) =>
    isDrive ? "" : `<circle class="knob" cx="${-y}" cy="${-x}" r="${r}" data-knob />`;

  // Return how long a pixel is on the floor [m], and how far from home a number may stand. The floor is not scaled
  // while something is dragged.
  function fit(poses) {
    const isNear = poses.every(({ x, y }) => Math.max(Math.abs(x), Math.abs(y)) <= NEAR_M);
    if (!dragged) scene.zoom(svg, isNear ? 0.5 : 1);
    const pixel = 1 / (svg.getScreenCTM()?.a || 450);
    svg.style.setProperty("--pixel", `${pixel}px`);
    return { pixel, within_m: (isNear ? 0.5 : 1) * AHEAD_M - SPOT * pixel };
  }

  function drawHandles() {
    const poses = posesOf(rows.read());
    const { pixel, within_m } = fit(poses);
    const way = [HOME, ...poses].map(({ x, y }) => `${-y} ${-x}`).join("L");
    const ways = poses.map(({ x, y, heading, isDrive }, index) => {
      const [kx, ky] = [x + KNOB * pixel * Math.cos(heading), y + KNOB * pixel * Math.sin(heading)];
      return `<g class="place" data-step="${index}"><path d="M${-y} ${-x}L${-ky} ${-kx}" />
        ${knobAt(isDrive, kx, ky, 12 * pixel)}</g>`;
    });
    const numbers = spotsOf(poses, APART * pixel, within_m).map(
      ({ x, y }, index) => `<g class="place" data-step="${index}"><circle class="spot" cx="${-y}" cy="${-x}"
        r="${SPOT * pixel}" /><text x="${-y}" y="${-x}" dy=".35em">${index + 1}</text></g>`,
    );
    handles.innerHTML = `<path class="planned" d="M${way}" />${ways.join("")}${numbers.join("")}`;
  }

  // Lead each step to where it is to end. Steps that only turn keep their heading.
  function lead(targets) {
    let from = HOME;
    const used = rows.used;
    targets.forEach((target, index) => {
      const move = target.isDrive ? moveTo(from, target) : rounded(between(target.heading - from.heading), 0);
      rows.write(used[index], move);
      from = posesOf(rows.read().slice(0, index + 1)).at(-1) ?? from;
    });
  }

  async function ask() {
    const steps = rows.read();
    if (!steps.length) return;
    const [lights, notes] = TRACKS.map((name) => document.getElementById(`id_${name}`)?.value ?? "");
    const query = new URLSearchParams({ steps: JSON.stringify(steps), lights, notes });
    const answer = await (await fetch(`${place.dataset.simulation}?${query}`)).json();
    preview = answer.preview;
    words.textContent = answer.words ?? "";
    problem.textContent = answer.problem ?? "";
    problem.hidden = !answer.problem;
    play.disabled = !preview;
    const poses = preview?.poses.map(([, x_m, y_m, heading_rad]) => ({ x_m, y_m, heading_rad })) ?? [];
    scene.draw({ poses, lights: [], mood: "calm" });
  }

  function changed() {
    drawHandles();
    clearTimeout(timer);
    timer = setTimeout(ask, PAUSE_MS);
  }

  function endDrag() {
    dragged = undefined;
    drawHandles();
  }

  function pointOf(event, beyond = { ahead: 0, left: 0 }) {
    const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    const [ahead, left] = [beyond.ahead - y, beyond.left - x];
    const share = Math.min(1, reach / (Math.hypot(ahead, left) || 1));
    return { x: ahead * share, y: left * share };
  }

  svg.addEventListener("pointerdown", (event) => {
    const target = event.target.closest("[data-step]");
    if (target) {
      const index = Number(target.dataset.step);
      const [own, at] = [posesOf(rows.read())[index], pointOf(event)];
      const turns = event.target.hasAttribute("data-knob");
      dragged = { index, turns, ahead: own.x - at.x, left: own.y - at.y }; // its number may stand beside its place
      svg.setPointerCapture(event.pointerId);
    } else if (rows.used.length < Number(place.dataset.most)) {
      rows.add(moveTo(posesOf(rows.read()).at(-1) ?? HOME, pointOf(event)));
      changed();
    }
    event.preventDefault();
  });
  svg.addEventListener("pointermove", (event) => {
    if (!dragged) return;
    const at = pointOf(event, dragged.turns ? undefined : dragged);
    const poses = posesOf(rows.read());
    const own = poses[dragged.index];
    // A drive ends with the heading that it has; only a step that turns on the spot can be turned.
    if (!own.isDrive) own.heading = Math.atan2(at.y - own.y, at.x - own.x);
    else if (!dragged.turns) Object.assign(own, at);
    lead(poses);
    changed();
  });
  for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, endDrag);

  place.querySelector("[data-home]").addEventListener("click", () => {
    const last = () => posesOf(rows.read()).at(-1) ?? HOME;
    const back = moveTo(last(), HOME);
    if (back.forward_m) rows.add(back);
    const { turn_deg } = rounded(between(-last().heading), 0);
    if (Math.abs(turn_deg) >= 1) rows.add({ turn_deg, forward_m: 0 });
    changed();
  });
  place.querySelector("[data-turn]").addEventListener("click", () => {
    rows.add({ turn_deg: 30, forward_m: 0 });
    changed();
  });
  play.addEventListener("click", async () => {
    play.disabled = true;
    audio ??= new AudioContext();
    await playPreview([scene, walker], preview, audio);
    play.disabled = false;
  });
  for (const kind of ["input", "formset:added", "formset:removed"]) form.addEventListener(kind, changed);
  new ResizeObserver(drawHandles).observe(svg);
  changed();
}
