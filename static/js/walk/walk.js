// The patient's page: what the socket says goes into the session, and once a frame onto the screen.

import { fillScreen, keepAwake } from "garry/walk/wake_lock";
import { createCelebration } from "garry/walk/confetti";
import { createControls } from "garry/walk/controls";
import { createFeedback } from "garry/walk/feedback";
import { createFitting } from "garry/walk/fit_text";
import { guardLeaving } from "garry/walk/leave_guard";
import { connect } from "garry/shared/session_socket";
import { createScene } from "garry/walk/scene";
import { apply, begin, look } from "garry/walk/state";
import { createSounds } from "garry/walk/sounds";

const PATIENCE_MS = 2_000; // a shorter break of the connection is not worth a word
const STILL_MS = 10_000; // after so long without a step the last one is no longer shown as now
const LEAVE_MS = 1_500;
const RESTLESS = new Set(["presence", "robot_stopped"]); // events that say nothing of walking

const { body } = document;
const mirrored = body.classList.contains("mirrored"); // in a frame on the therapist's page
const scene = createScene(body.querySelector(".scene"));
const { celebrate, clear } = createCelebration(body.querySelector(".confetti"));
const sound = mirrored ? () => {} : createSounds(body.querySelector(".sound"));
const drawFeedback = createFeedback(body);
const fitCalm = createFitting(body);
const page = { link: "", asking: false, still: false };
let session, why, waiting, breaking, drawing, leaving;
let confetti = "none";

const live = connect(body.dataset.socket, {
  onSnapshot(snapshot) {
    session = begin(snapshot);
    rest();
  },
  onEvent(event) {
    apply(session, event);
    if (event.kind === "step" && event.live && !document.hidden) {
      confetti = event.confetti;
      sound(event);
    }
    if (RESTLESS.has(event.kind)) redraw();
    else rest();
  },
  onLink(state, reason) {
    clearTimeout(breaking);
    const note = () => {
      page.link = state;
      why = reason;
      redraw();
    };
    if (state === "lost") breaking = setTimeout(note, PATIENCE_MS);
    else note();
  },
});
const { showRobot, keepFocus } = createControls(body, live, (asking) => {
  page.asking = asking;
  redraw();
});

// Starts to wait for the next step.
function rest() {
  page.still = false;
  clearTimeout(waiting);
  waiting = setTimeout(() => {
    page.still = true;
    redraw();
  }, STILL_MS);
  redraw();
}

function redraw() {
  drawing ??= requestAnimationFrame(draw);
}

function draw() {
  drawing = undefined;
  const now = look(session, page);
  const theme = now === "feedback" ? session.phase.theme : "calm";
  if (body.dataset.theme !== theme) body.dataset.theme = theme;
  const changed = body.dataset.look !== now;
  if (changed) body.dataset.look = now;
  if (now !== "paused" && now !== "ask") page.asking = false;
  drawFeedback(now, session, why);
  if (session) showRobot(session);
  if (changed) keepFocus();
  if (now !== "feedback") fitCalm();
  if (now === "feedback") {
    const { last, steps } = session;
    scene.show({
      performance: last?.kind === "missing" ? null : last?.performance,
      hit: last?.hit ?? false,
      strides: steps,
    });
    celebrate(confetti);
  } else clear();
  confetti = "none";
  if (session) body.dataset.step = session.number;
  if (now === "ended" && !mirrored) leaving ??= setTimeout(() => location.replace(body.dataset.scores), LEAVE_MS);
}

redraw();
if (!mirrored) {
  keepAwake();
  guardLeaving(body.querySelector("dialog.leave"));
}
if (body.classList.contains("alone")) fillScreen();
