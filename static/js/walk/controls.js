// The page's buttons: start, pause, go on, end (asked twice) and the robot's stop; and where the
// keyboard's focus goes when a button disappears.

import { _ } from "garry/shared/language";

const GUARD_MS = 700; // a question that just appeared takes no answer: the tap may be a double tap
const NOTE_MS = 6_000;
const ANSWER_MS = 450; // after which a stop that nobody confirmed is told as unheard
const UNHEARD = _("The stop did not get through. Use the robot’s own switch, or call your therapist.");

export function createControls(body, socket, showQuestion) {
  const note = body.querySelector(".note");
  const robot = body.querySelector(".robot");
  const label = robot.textContent;
  let hideTimer, orderTimer, focused;
  let [orderText, isStopped] = ["", false];

  function notify(message) {
    note.textContent = message;
    note.hidden = false;
    clearTimeout(hideTimer);
    hideTimer = setTimeout(() => (note.hidden = true), NOTE_MS);
  }

  // Show what the patient cannot mend, for as long as it lasts.
  function tellTherapist(message) {
    clearTimeout(hideTimer);
    note.textContent = message;
    note.hidden = false;
  }

  async function change(button) {
    button.disabled = true;
    try {
      await socket.change(button.dataset.change);
    } catch (problem) {
      notify(problem.message);
    }
    button.disabled = false;
    keepFocus();
  }

  function askToEnd(asked) {
    showQuestion(asked);
    const answers = body.querySelectorAll("[data-change=finish], [data-ask='']");
    const lock = (isLocked) => answers.forEach((answer) => (answer.disabled = isLocked));
    lock(asked);
    if (asked) setTimeout(() => (lock(false), keepFocus()), GUARD_MS);
  }

  // Show at once that the tap was registered; the server says when the robot is stopped.
  function stopRobot() {
    const sent = socket.send({ type: "robot", order: "stop" });
    if (!sent) notify(UNHEARD);
    showOrder(sent ? _("Stop sent") : _("Not sent"));
    clearTimeout(orderTimer);
    orderTimer = setTimeout(sent ? reportUnanswered : () => showOrder(""), sent ? ANSWER_MS : NOTE_MS);
  }

  function reportUnanswered() {
    clearTimeout(orderTimer);
    if (!isStopped) notify(UNHEARD);
    showOrder("");
  }

  function showOrder(text) {
    orderText = text;
    drawRobot();
  }

  function drawRobot() {
    const text = isStopped ? _("Robot stopped") : orderText || label;
    if (robot.textContent !== text) robot.textContent = text;
    robot.toggleAttribute("data-said", text !== label);
  }

  const usable = (element) =>
    element.isConnected && !element.disabled && element.checkVisibility({ visibilityProperty: true });

  // Keyboard focus moves to the button that takes the place of the one that has gone.
  function keepFocus() {
    if (!focused || (document.activeElement !== body && usable(document.activeElement))) return;
    [focused, ...body.querySelectorAll(".actions .main, header .pause")].find(usable)?.focus();
  }

  body.addEventListener("focusin", ({ target }) => (focused = target));
  body.addEventListener("click", ({ target }) => {
    const button = target.closest("button");
    if (!button) return;
    if (button === robot) stopRobot();
    else if (button.dataset.change) change(button);
    else if (button.dataset.ask !== undefined) askToEnd(button.dataset.ask === "end");
    else if (button.dataset.reload !== undefined) location.reload();
  });
  body.addEventListener("contextmenu", (event) => event.preventDefault()); // of a long press

  function showRobot({ presence, robot_stopped }) {
    isStopped = robot_stopped;
    robot.hidden = !presence.robot;
    drawRobot();
  }

  return { showRobot, keepFocus, tellTherapist };
}
