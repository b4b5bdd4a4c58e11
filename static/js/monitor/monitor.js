// The PT's page: shows what the server says, and asks it for changes. It computes no score.
//
// Each control and panel is a module that gets the `page` and returns draw(session) and, where events change what
// it shows, `events`: a function (session, event) for each kind.

import { _ } from "garry/shared/language";
import { connect } from "garry/shared/session_socket";
import { whyHeld } from "garry/monitor/alarm_causes";
import { createAlarms } from "garry/monitor/alarms";
import { createConnections } from "garry/monitor/connections";
import { createActivationThreshold } from "garry/monitor/controls/activation_threshold";
import { createFall } from "garry/monitor/controls/fall";
import { createFeedbackType } from "garry/monitor/controls/feedback_type";
import { createGain } from "garry/monitor/controls/gain";
import { createGoalCoach } from "garry/monitor/controls/goal_coach";
import { createGoal } from "garry/monitor/controls/goal";
import { createNote } from "garry/monitor/controls/note";
import { createPatientPage } from "garry/monitor/controls/patient_page";
import { createPhase } from "garry/monitor/controls/phase";
import { createRemarks } from "garry/monitor/controls/remarks";
import { createRobotLevel } from "garry/monitor/controls/robot_level";
import { createRunState } from "garry/monitor/controls/run_state";
import { createWalking } from "garry/monitor/controls/walking";
import { createLastStride } from "garry/monitor/last_stride";
import { createReadiness } from "garry/monitor/readiness";
import { RobotPanel } from "garry/monitor/robot";
import { MonitorState } from "garry/monitor/state";
import { createStrideCharts } from "garry/monitor/stride_charts";

const ANNOUNCED_MS = 8_000;
const ENDED = new Set(["finished", "aborted"]);

const root = document.getElementById("monitor");
const slots = new Map([...document.querySelectorAll("[data-show]")].map((slot) => [slot.dataset.show, slot]));
const state = new MonitorState();
let frame = 0; // the one that is asked for
let hiding;

function show(slotName, text) {
  const slot = slots.get(slotName);
  if (slot && slot.textContent !== text) slot.textContent = text;
}

function announce(text) {
  const note = document.querySelector(".said");
  note.textContent = text;
  clearTimeout(hiding);
  hiding = setTimeout(() => (note.textContent = ""), ANNOUNCED_MS);
}

// Call `handler(button, session)` when a button that the selector finds is pressed.
function onPress(selector, handler) {
  document.addEventListener("click", ({ target }) => {
    const button = target.closest("button");
    if (button?.matches(selector) && state.session) handler(button, state.session);
  });
}

const socket = connect(root.dataset.socket, {
  onSnapshot(snapshot) {
    state.reset(snapshot);
    robot.reset(snapshot);
    draw();
  },
  onSteps(strides) {
    state.addMissed(strides);
    draw();
  },
  onEvent(event) {
    state.apply(event);
    robot.handleEvent(event);
    for (const { events } of parts) events?.[event.kind]?.(state.session, event);
    if (!frame) frame = requestAnimationFrame(draw);
  },
  onLink(link, reason) {
    const note = document.querySelector(".notice.link"); // a lost one is told by its silence (alarm_causes.js)
    note.hidden = link === "open" || (link === "lost" && Boolean(state.session));
    note.textContent = link === "lost" ? _("No connection to the server. This page tries again by itself.") : reason;
    if (link === "closed" && state.session) leaveWhenEnded();
  },
});

const page = {
  state,
  socket,
  show,
  announce,
  onPress,
  change: (kind, value) => socket.change(kind, value).catch((problem) => announce(problem.message)),
  note: (what, value) => socket.ask({ type: "remark", what, value }),
  remark: (what, value) => page.note(what, value).catch((problem) => announce(problem.message)),
  orderRobot: (order) => socket.send({ type: "robot", order }),
  driveRobot: (drive) => socket.send({ type: "robot", order: "drive", ...drive }),
  orderStop: () => robot.order("stop"),
};
const robot = (page.robot = new RobotPanel(document.querySelector(".robot"), page));
const connections = createConnections(page);
const parts = [
  createRunState(page),
  createPhase(page),
  createLastStride(page),
  connections,
  createFeedbackType(page),
  createPatientPage(page),
  createGoal(page),
  createGoalCoach(page),
  createActivationThreshold(page),
  createRobotLevel(page),
  createGain(page),
  createRemarks(page),
  createNote(page),
  createWalking(page),
  createStrideCharts(page),
  robot,
  createAlarms(page),
  createFall(page), // in its banner
  createReadiness(robot),
];

// Not before it is said how badly somebody who fell is hurt.
function leaveWhenEnded() {
  if (ENDED.has(state.session.state) && !whyHeld(state.session)) location.assign(root.dataset.details);
}

function draw() {
  frame = 0;
  if (!state.session) return;
  for (const part of parts) part.draw?.(state.session);
  leaveWhenEnded();
}

setInterval(() => state.session && connections.draw(state.session), 1_000); // silence sends no event
addEventListener("resize", draw);
