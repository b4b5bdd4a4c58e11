// Fall: the robot stops and the session pauses at once; then it is noted, and asked how badly somebody is hurt.
// Whoever tapped by mistake withdraws the note alone: going on, and letting the robot move, are taps of their own.

import { _, fill } from "garry/shared/language";
import { hasFallen } from "garry/monitor/alarm_causes";
import { openDialog } from "garry/monitor/controls/open_dialog";

const WITHDRAWN_WITHIN_MS = 10_000;
const REFRESH_MS = 250;

export function createFall({ state: told, show, announce, onPress, change, note, remark, orderStop }) {
  const button = document.querySelector("[data-fall]");
  const dialog = document.getElementById("fall");
  const withdraw = dialog.querySelector("[data-withdraw]");
  let [timer, until] = [0, 0];

  function countDown() {
    const left = until - performance.now();
    withdraw.hidden = left <= 0;
    withdraw.textContent = fill(_("It was not a fall (%(count)s s)"), { count: Math.ceil(left / 1000) });
    if (withdraw.hidden) clearInterval(timer);
  }

  function ask() {
    until = performance.now() + WITHDRAWN_WITHIN_MS;
    clearInterval(timer);
    timer = setInterval(countDown, REFRESH_MS);
    countDown();
    openDialog(dialog, (answer) => {
      clearInterval(timer);
      if (answer === "withdraw") remark("fall_withdrawn");
      else if (answer) remark("fall_severity", Number(answer));
    });
  }

  async function store() {
    show("fall", _("The robot is told to stop, and the session to pause."));
    try {
      await note("fall");
      show("fall", _("Noted. First take care of the patient: this question can wait."));
    } catch (problem) {
      dialog.close("");
      announce(fill(_("The fall is not noted: %(problem)s"), { problem: problem.message }));
    }
  }

  onPress("[data-fall]", (_button, { state }) => {
    orderStop();
    told.fellHere = true;
    if (state === "running") change("pause");
    if (dialog.open) return; // tapped twice: one fall
    store();
    ask();
  });

  return {
    draw(session) {
      button.disabled = !["ready", "running", "paused"].includes(session.state);
      show("fall-again", hasFallen(session) ? _("Another fall") : _("Fall"));
    },
  };
}
