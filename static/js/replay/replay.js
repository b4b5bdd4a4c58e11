// A session's room, played again: the drawings of the therapist's page and the patient's page, with a player where
// the socket was.

import { _, fill } from "garry/shared/language";
import { clock } from "garry/shared/format";
import { icon } from "garry/shared/svg";
import { createLastStride } from "garry/monitor/last_stride";
import { createPhaseBar } from "garry/monitor/phase_bar";
import { MonitorState } from "garry/monitor/state";
import { createStrideCharts } from "garry/monitor/stride_charts";
import { Player } from "garry/replay/player";
import { createReplayedRobot } from "garry/replay/robot";

const log = JSON.parse(document.getElementById("played").textContent);
const slots = new Map([...document.querySelectorAll("[data-show]")].map((slot) => [slot.dataset.show, slot]));
const [slider, main] = ["#moment", "[data-play]"].map((selector) => document.querySelector(selector));
const entries = [...document.querySelectorAll("[data-at]")];
const state = new MonitorState();
let frame = 0;

function show(slotName, text) {
  const slot = slots.get(slotName);
  if (slot && slot.textContent !== text) slot.textContent = text;
}

const player = new Player(log, () => (frame ||= requestAnimationFrame(draw)));
window.replayPlayer = player; // for the patient's page in its frame
const page = { state, show };
document.querySelector("section.robot").hidden = !log.snapshots.monitor.presence.robot;
const robot = createReplayedRobot(page, log.robot, player);
const drawPhases = createPhaseBar(document.querySelector(".phases"));
const parts = [createLastStride(page), createStrideCharts(page), robot];

player.join("monitor", {
  onSnapshot(snapshot) {
    state.lastStride = null;
    state.reset(snapshot);
    robot.reset();
  },
  onEvent(event) {
    state.apply(event);
    robot.handleEvent(event);
  },
});

function draw() {
  frame = 0;
  if (!state.session) return;
  for (const part of parts) part.draw(state.session);
  drawPhases(state.session);
  drawTransport();
}

function drawTransport() {
  const { at_s, took_s, isPlaying } = player;
  slider.max = took_s;
  slider.value = at_s;
  slider.setAttribute("aria-valuetext", fill(_("%(time)s of %(all)s"), { time: clock(at_s), all: clock(took_s) }));
  show("clock", `${clock(at_s)} / ${clock(took_s)}`);
  const label = isPlaying ? _("Pause") : _("Play");
  if (main.dataset.of !== label) {
    main.dataset.of = label;
    main.innerHTML = `${icon(isPlaying ? "pause" : "play")}<span>${label}</span>`;
  }
  const last = entries.findLast(({ dataset }) => Number(dataset.at) <= at_s);
  for (const entry of entries) {
    entry.classList.toggle("later", Number(entry.dataset.at) > at_s);
    if (entry === last) entry.setAttribute("aria-current", "step");
    else entry.removeAttribute("aria-current");
  }
  if (!isPlaying) history.replaceState(null, "", `?at=${at_s.toFixed(2)}`); // the address of this moment
}

const STEPS = { ArrowLeft: -1, ArrowRight: 1 };

main.addEventListener("click", () => (player.isPlaying ? player.pause() : player.play()));
slider.addEventListener("input", () => player.moveTo(Number(slider.value)));
slider.addEventListener("keydown", (event) => {
  if (!(event.key in STEPS)) return;
  event.preventDefault(); // a stride, not a part of a second
  player.step(STEPS[event.key]);
});
document
  .querySelector("[data-speed]")
  .addEventListener("change", ({ target }) => (player.speed = Number(target.value)));
for (const button of document.querySelectorAll("[data-step]"))
  button.addEventListener("click", () => player.step(Number(button.dataset.step)));
for (const entry of entries) entry.addEventListener("click", () => player.moveTo(Number(entry.dataset.at)));
addEventListener("resize", draw);
addEventListener("hashchange", begin);

// Show the moment that the address names: a stride, a time, or the start.
function begin() {
  const stride = location.hash.match(/^#stride-(\d+)$/)?.[1];
  if (stride) player.moveToStride(Number(stride));
  else player.moveTo(Number(new URLSearchParams(location.search).get("at")) || 0);
}

begin();
const screen = document.querySelector(".screen iframe");
screen.src = screen.dataset.src; // only now: it looks for the player
