// The patient's page: what the socket sends goes into the session, and once a frame onto the screen.

import { fillScreen, keepAwake } from "garry/walk/wake_lock";
import { createCelebration } from "garry/walk/confetti";
import { createControls } from "garry/walk/controls";
import { createFeedback } from "garry/walk/feedback";
import { createFitting } from "garry/walk/fit_layout";
import { guardLeaving } from "garry/walk/leave_guard";
import { connect } from "garry/shared/session_socket";
import { createScene } from "garry/walk/scene";
import { applyEvent, fromSnapshot, screenOf } from "garry/walk/state";
import { createSounds } from "garry/walk/sounds";
import { samplesOf } from "garry/walk/text";

const WATCH_MS = 250; // silence sends no event
const STILL_MS = 4_000; // after so long without a step the last one is no longer shown as current
const LEAVE_MS = 1_500;
// Events that are no sign of walking.
const NOT_WALKING = new Set(["presence", "robot_stopped", "alarms"]);

const { body } = document;
const isMirror = body.classList.contains("mirrored"); // in a frame on the therapist's page
const scene = createScene(body.querySelector(".scene"));
const { celebrate, clear } = createCelebration(body.querySelector(".confetti"));
const sound = isMirror ? () => {} : createSounds(body.querySelector(".sound"));
const drawFeedback = createFeedback(body);
const fit = createFitting(body, scene);
const page = { link: "", silent_s: 0, asking: false, still: false };
let session, frame, leaveTimer;
let stopWaiting = () => {};
let confetti = "none";

const socket = connect(body.dataset.socket, {
  onSnapshot(snapshot) {
    session = fromSnapshot(snapshot);
    watchServer();
    awaitStep();
  },
  onEvent(event) {
    if (event.kind === "feedback_text") {
      if (event.language !== document.documentElement.lang) location.reload(); // all of it, not its words alone
      return;
    }
    applyEvent(session, event);
    watchServer();
    if (event.kind === "step" && event.live && !document.hidden) {
      confetti = event.confetti;
      sound({ ...event, performance: stretch(event.performance) });
    }
    if (NOT_WALKING.has(event.kind)) redraw();
    else awaitStep();
  },
  onLink(state, reason) {
    if (state === "lost") return; // told by its silence: a short break is not shown
    page.link = state;
    if (state === "closed") tellTherapist(reason);
    redraw();
  },
});
const { showRobot, keepFocus, tellTherapist } = createControls(body, socket, (asking) => {
  page.asking = asking;
  redraw();
});

// Begin to wait for the next step.
function awaitStep() {
  page.still = false;
  stopWaiting();
  stopWaiting = socket.after(STILL_MS, () => {
    page.still = true;
    redraw();
  });
  redraw();
}

// What never comes near 0 is drawn on a scale that begins `span` below the goal (training/measures.py).
const stretch = (performance) => (performance == null ? performance : 1 + (performance - 1) / session.span);

function redraw() {
  frame ??= requestAnimationFrame(draw);
}

function draw() {
  frame = undefined;
  const screen = screenOf(session, page);
  const theme = screen === "feedback" ? session.phase.theme : "calm";
  if (body.dataset.theme !== theme) body.dataset.theme = theme;
  const hasChanged = body.dataset.look !== screen;
  if (hasChanged) body.dataset.look = screen;
  if (screen !== "paused" && screen !== "ask") page.asking = false;
  drawFeedback(screen, session, page);
  if (session) showRobot(session);
  if (hasChanged) keepFocus();
  fit(screen, samplesOf(session));
  if (screen === "feedback") {
    const { last, steps } = session;
    scene.show({
      performance: last?.kind === "missing" ? null : stretch(last?.performance),
      hit: last?.hit ?? false,
      close: last?.close ?? false,
      strides: steps.map((stride) => ({ ...stride, performance: stretch(stride.performance) })),
      isCut: session.span < 1,
    });
    celebrate(confetti);
  } else clear();
  confetti = "none";
  if (session) body.dataset.step = session.number;
  if (session) body.toggleAttribute("data-sensor", session.presence.source);
  if (screen === "ended" && !isMirror) leaveTimer ??= setTimeout(() => location.replace(body.dataset.ending), LEAVE_MS);
}

// Nothing that is old counts as present: the page says since when, and turns gray.
function watchServer() {
  if (page.link === "closed") return;
  const silent_s = socket.isStale() ? Math.floor(socket.silentFor() / 1000) : 0;
  if (silent_s === page.silent_s) return;
  page.silent_s = silent_s;
  page.link = silent_s ? "lost" : "open";
  body.classList.toggle("stale", silent_s > 0);
  redraw();
}
setInterval(watchServer, WATCH_MS);

addEventListener("resize", redraw); // words fit another place
// Its zero has a file of its own, which the first score would ask for.
document.fonts.load(`1em ${getComputedStyle(body).fontFamily}`, "0").catch(() => {});
document.fonts.ready.then(redraw);
redraw();
if (!isMirror) {
  keepAwake();
  guardLeaving(body.querySelector("dialog.leave"));
}
if (body.classList.contains("alone")) fillScreen();
