// The page's buttons: start, pause, go on, end (asked twice) and the robot's stop; and where the
// keyboard's focus goes when a button leaves.

import { _ } from "garry/shared/language";

const GUARD_MS = 700; // a question that just appeared takes no answer: a second tap is no yes
const NOTE_MS = 6_000;
const ANSWER_MS = 2_000; // after which a link that nobody has closed is not believed

export function createControls(body, live, ask) {
  const note = body.querySelector(".note");
  const robot = body.querySelector(".robot");
  const label = robot.textContent;
  let hiding, resetting, held;
  let [said, stopped] = ["", false];

  function tell(message) {
    note.textContent = message;
    note.hidden = false;
    clearTimeout(hiding);
    hiding = setTimeout(() => (note.hidden = true), NOTE_MS);
  }

  async function change(button) {
    button.disabled = true;
    try {
      await live.change(button.dataset.change);
    } catch (problem) {
      tell(problem.message);
    }
    button.disabled = false;
    keepFocus();
  }

  function question(asked) {
    ask(asked);
    const yes = body.querySelector("[data-change=finish]");
    yes.disabled = asked;
    if (asked) setTimeout(() => (yes.disabled = false), GUARD_MS);
  }

  // Says at once that the tap was heard; that the robot is stopped is the server's word.
  function stopRobot() {
    const sent = live.say({ type: "robot", order: "stop" });
    if (!sent) tell(_("No connection. Use the robot's own button."));
    answer(sent ? _("Stop sent") : _("Not sent"));
    clearTimeout(resetting);
    resetting = setTimeout(sent ? doubt : () => answer(""), sent ? ANSWER_MS : NOTE_MS);
  }

  function doubt() {
    if (!stopped) tell(_("No answer. Use the robot's own button."));
    answer("");
  }

  function answer(words) {
    said = words;
    drawRobot();
  }

  function drawRobot() {
    const words = stopped ? _("Robot stopped") : said || label;
    if (robot.textContent !== words) robot.textContent = words;
    robot.toggleAttribute("data-said", words !== label);
  }

  const usable = (element) =>
    element.isConnected && !element.disabled && element.checkVisibility({ visibilityProperty: true });

  // Who steers by keys goes on from the button that takes the place of the one that has gone.
  function keepFocus() {
    if (!held || (document.activeElement !== body && usable(document.activeElement))) return;
    [held, ...body.querySelectorAll(".actions .main, header .pause")].find(usable)?.focus();
  }

  body.addEventListener("focusin", ({ target }) => (held = target));
  body.addEventListener("click", ({ target }) => {
    const button = target.closest("button");
    if (!button) return;
    if (button === robot) stopRobot();
    else if (button.dataset.change) change(button);
    else if (button.dataset.ask !== undefined) question(button.dataset.ask === "end");
    else if (button.dataset.reload !== undefined) location.reload();
  });
  body.addEventListener("contextmenu", (event) => event.preventDefault()); // of a long press

  function showRobot({ presence, robot_stopped }) {
    stopped = robot_stopped;
    robot.hidden = !presence.robot;
    drawRobot();
  }

  return { showRobot, keepFocus };
}
