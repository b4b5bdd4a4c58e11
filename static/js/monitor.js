// The PT's page: shows what the server says, and asks it for changes. It computes no score.
import { _, fill, number } from "garry/language";
import { drawControls, drawTypes } from "garry/controls";
import { connect } from "garry/live";
import { legend, say } from "garry/marks";
import { phaseName, reasonName } from "garry/names";
import { quality } from "garry/presence";
import { drawStrip, drawTwenty, drawRing } from "garry/plots";
import { RobotPanel } from "garry/robot";

const root = document.getElementById("monitor");
const slots = new Map([...document.querySelectorAll("[data-show]")].map((slot) => [slot.dataset.show, slot]));
const KEPT = 400; // strides on the strip
const TYPES = ["began", "changed_to", "valence", "next_valence", "types"];
const ENDED = new Set(["finished", "aborted"]);

let session = null; // the last snapshot, brought up to date by events
let strides = [];
let marks = []; // changes and remarks, each after a stride
let heardAt = 0; // when presence was told
let last = null;

const robot = new RobotPanel(document.querySelector(".robot"), show, (order) => live.say({ type: "robot", order }), tell);
const live = connect(root.dataset.socket, {
  onSnapshot(snapshot) {
    session = snapshot;
    strides = snapshot.steps.slice(-KEPT);
    marks = snapshot.marks;
    heardAt = performance.now();
    last ??= strides.at(-1) ?? null;
    robot.begin(snapshot);
    draw();
  },
  onSteps(steps) {
    const known = new Set(strides.map(({ number }) => number));
    strides = [...strides, ...steps.filter(({ number }) => !known.has(number))].sort((a, b) => a.number - b.number).slice(-KEPT);
    draw();
  },
  onEvent(event) {
    take(event);
    if (!drawing) drawing = requestAnimationFrame(draw);
  },
  onLink(state, why) {
    const note = document.querySelector(".notice.link");
    note.hidden = state === "open";
    note.textContent = state === "lost" ? _("No connection to the server. What the patient walks is stored; this page comes back by itself.") : why;
    if (state === "closed" && session && ENDED.has(session.state)) location.assign(root.dataset.details);
  },
});
let drawing = 0;

function take(event) {
  if (event.mark) marks.push(event.mark);
  switch (event.kind) {
    case "step":
      Object.assign(session, pick(event, ["active_s", "phase_s", "phase_strides"]));
      session.number = event.number;
      if (event.side !== session.trained_side) break;
      Object.assign(session, pick(event, ["hit_rate", "hits", "judged", "score"]));
      strides.push(event);
      if (strides.length > KEPT) strides.shift();
      if (event.live) last = event;
      Object.assign(session.presence, { stride_ago_s: 0, tablet_ago_s: waited(session.presence.tablet_ago_s) });
      heardAt = performance.now();
      break;
    case "state":
      Object.assign(session, pick(event, ["state", "pause_reason"]));
      break;
    case "phase":
      Object.assign(session, pick(event, ["phase", "goal", "gain", "obstacle", "active_s", "phase_s", "phase_strides", ...TYPES]));
      break;
    case "valence":
      Object.assign(session, pick(event, TYPES));
      break;
    case "words_shown":
      session.words_shown = event.value;
      break;
    case "chart_style":
      session.chart = event.value;
      break;
    case "feedback_text":
      tell(_("The clinic’s words were edited; the patient reads them from the next step."));
      break;
    case "goal":
      session.goal = event.goal;
      break;
    case "gain":
      session.gain = event.gain;
      break;
    case "activation_threshold":
      session.activation_threshold = event.value;
      break;
    case "robot_intensity":
      session.robot_intensity = event.value;
      break;
    case "presence":
      session.presence = event.presence;
      heardAt = performance.now();
      robot.take(event);
      break;
    case "remark":
      marks.push({ after: event.number, kind: event.what, value: event.value });
      tell(fill(_("Noted: %(what)s"), { what: say({ kind: event.what, value: event.value }) }));
      break;
    case "source_goal":
      tell(fill(_("The sensor’s own goal is %(goal)s; yours counts."), { goal: number(event.goal, 2) }));
      break;
    default:
      robot.take(event);
  }
}

const waited = (seconds) => (seconds === null || seconds === undefined ? null : seconds + (performance.now() - heardAt) / 1000);

function pick(from, names) {
  return Object.fromEntries(names.filter((name) => from[name] !== undefined).map((name) => [name, from[name]]));
}

function show(name, text) {
  const slot = slots.get(name);
  if (slot && slot.textContent !== text) slot.textContent = text;
}

const percent = (share) => `${number(100 * share)} %`;
const minutes = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;

function draw() {
  drawing = 0;
  if (!session) return;
  const planned = session.target.duration_s;
  show("clock", minutes(session.active_s));
  const over = session.completed || (planned && session.active_s >= planned);
  show("planned", over ? _("planned time reached") : planned ? fill(_("of %(time)s"), { time: minutes(planned) }) : _("walked"));
  document.querySelector(".end").classList.toggle("over", Boolean(over));
  drawPhases();
  drawLast();
  drawPresence();
  drawControls(session, show);
  if (ENDED.has(session.state)) location.assign(root.dataset.details);
  const judged = strides.filter(({ performance }) => performance !== null).slice(-20);
  show("of-twenty", judged.length ? fill(_("%(hits)s of %(count)s hit"), { hits: judged.filter(({ hit }) => hit).length, count: judged.length }) : "");
  drawStrip(document.getElementById("strip"), strides, marks, session.phases);
  drawLegend();
  drawTwenty(document.getElementById("twenty"), strides.slice(-20));
  drawRing(document.getElementById("ring"), session.hit_rate, session.target.hit_rate);
  show("wanted", session.target.hit_rate ? fill(_("Wanted %(rate)s"), { rate: percent(session.target.hit_rate) }) : _("No rate set"));
  show("judged", session.judged === undefined ? "" : fill(_("%(hits)s of %(count)s strides"), { hits: session.hits, count: session.judged }));
  robot.draw();
}

function drawPhases() {
  const list = document.querySelector(".phases"), now = session.phase.index;
  if (list.children.length !== session.phases.length) {
    list.replaceChildren(...session.phases.map(({ name }) => Object.assign(document.createElement("li"), { textContent: phaseName(name) })));
  }
  [...list.children].forEach((item, index) => {
    item.className = index < now ? "was" : index === now ? "is" : "";
    if (index === now) item.setAttribute("aria-current", "step");
    else item.removeAttribute("aria-current");
  });
}

function drawLast() {
  const goal = session.goal === null ? null : number(session.goal, 2);
  show("goal-line", goal ? fill(_("goal %(goal)s"), { goal: `${goal} ${session.unit}` }) : session.obstacle || _("The goal follows from the baseline."));
  if (!last) return;
  const valid = last.performance !== null && last.performance !== undefined;
  const { value, gain } = last;
  show("number", fill(_("no. %(number)s"), { number: last.number }));
  show("performance", valid ? percent(last.performance) : "—");
  // What the patient sees is gain × value, and the goal is compared with that.
  const scaled = gain && gain !== 1 ? ` × ${number(gain, 2)} = ${number(gain * value, 2)}` : "";
  show("value", value === null || value === undefined ? "" : `${number(value, 2)}${scaled} ${session.unit}`);
  show("extras", Object.entries(last.extra ?? {}).map(([name, value]) => `${name} ${number(+value.toPrecision(3), null)}`).join("\n"));
  const points = last.points ? `, ${last.points > 0 ? "+" : "−"}${Math.abs(last.points)}` : "";
  const why = last.valid ? fill(_("%(phase)s: no goal yet"), { phase: phaseName(session.phase.name) }) : fill(_("does not count: %(why)s"), { why: (last.reasons ?? []).map(reasonName).join(", ") || _("no value") });
  show("verdict", valid ? (last.hit ? _("hit") : _("below")) + points : why);
  const dot = document.querySelector(".verdict .dot");
  dot.hidden = !valid;
  dot.classList.toggle("miss", !last.hit);
}

function drawLegend() {
  const list = document.querySelector(".legend"), entries = legend(marks);
  const text = entries.map((entry) => entry.join(" ")).join();
  if (list.dataset.of === text) return;
  list.dataset.of = text;
  list.replaceChildren(
    ...entries.map(([sign, words]) => {
      const item = document.createElement("li");
      item.append(Object.assign(document.createElement("b"), { textContent: sign }), ` ${words}`);
      return item;
    }),
  );
}

function drawPresence() {
  if (!session) return;
  const found = quality(session, strides, robot.presence, (performance.now() - heardAt) / 1000);
  for (const row of document.querySelectorAll("[data-presence]")) {
    const [sign, words] = found[row.dataset.presence];
    row.classList.toggle("there", sign !== "–");
    row.classList.toggle("low", sign === "!");
    const text = `${sign} ${words}`, place = row.querySelector("small");
    if (place.textContent !== text) place.textContent = text;
  }
}
setInterval(drawPresence, 1_000); // what is silent says nothing by itself

function tell(words) {
  const note = document.querySelector(".said");
  note.textContent = words;
  clearTimeout(tell.timer);
  tell.timer = setTimeout(() => (note.textContent = ""), 8_000);
}

function change(kind, value) {
  return live.change(kind, value).catch((problem) => tell(problem.message));
}

function note(what, value) {
  live.ask({ type: "remark", what, value }).catch((problem) => tell(problem.message));
}

// Before the baseline is complete a goal can be set from what has been walked so far.
function setFirstGoal() {
  const values = strides.filter(({ valid, value }) => valid && value > 0).map(({ value }) => value);
  if (values.length < 5) tell(_("The goal follows from the baseline. Walk five steps to set one from them."));
  else change("goal", Number((values.reduce((sum, value) => sum + value, 0) / values.length).toFixed(2)));
}

// About 2.5 % of the goal, in steps that are easy to say.
function goalStep(goal) {
  const size = 10 ** Math.floor(Math.log10(goal / 40));
  return [1, 2, 5, 10].map((n) => n * size).find((step) => step >= goal / 40);
}

document.addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (!button || !session) return;
  const { goal, threshold, nextPhase, main, end, robot: order, remark } = button.dataset;
  if (goal !== undefined && session.goal !== null) {
    const step = goalStep(session.goal);
    change("goal", Number((Math.round(session.goal / step + Number(goal)) * step).toFixed(4)));
  } else if (goal !== undefined) setFirstGoal();
  else if (threshold !== undefined) change("activation_threshold", Number((session.activation_threshold + Number(threshold)).toFixed(2)));
  else if (nextPhase !== undefined) change("phase", session.phase.index + 1);
  else if (main !== undefined) change(button.value);
  else if (end !== undefined) document.getElementById("sure").showModal();
  else if (order !== undefined) robot.order(order);
  else if (remark === "borg") document.getElementById("exertion").showModal();
  else if (remark !== undefined) note(remark);
  else if (button.parentElement.dataset.levels !== undefined) change("robot_intensity", Number(button.value));
  else if (button.parentElement.dataset.gains !== undefined) change("gain", Number(button.value));
  else if (button.parentElement.dataset.words !== undefined) change("words_shown", Number(button.value));
  else if (button.parentElement.dataset.chart !== undefined) change("chart_style", button.value);
});

document.querySelector("[data-type]").addEventListener("change", ({ target }) => {
  target.dataset.of = ""; // what was refused goes back to what holds
  if (session) change("valence", target.value).finally(() => drawTypes(session, show));
});

document.getElementById("exertion").addEventListener("close", ({ target }) => {
  if (target.returnValue) note("borg", Number(target.returnValue));
  target.returnValue = "";
});

addEventListener("resize", () => session && draw());

document.getElementById("sure").addEventListener("close", ({ target }) => {
  if (target.returnValue === "end") change(session.state === "ready" ? "abort" : "finish");
  target.returnValue = "";
});
