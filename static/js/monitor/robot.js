// The robot on the PT's page: where it is, what it does, why it did or did not move, and its stop.

import { _, fill } from "garry/shared/language";
import { percent } from "garry/shared/format";
import { whyHeld } from "garry/monitor/alarm_causes";
import { RobotPlacing } from "garry/monitor/robot_placing";
import {
  cureOf,
  describeDecision,
  describeGesture,
  describeHoming,
  describeReason,
  describeState,
} from "garry/monitor/robot_text";
import { RobotScene } from "garry/shared/robot_scene";

const KEPT_POSES = 240;
const STOP_MS = 450; // after which a stop that nobody confirmed is told as unheard
const ANSWER_MS = 2_000; // of any other order
// Reasons in its status that a therapist should know of; the others are expected.
const NOTABLE = new Set([
  "unwatched",
  "charging",
  "battery_low",
  "away_from_home",
  "base_silent",
  "firmware_unknown",
  "firmware_refused",
  "bump",
  "cliff",
  "wheel_drop",
  "over_current",
  "button",
  "nobody_listens",
  "feeler_missing",
  "nobody_watches",
  "wrong_mode",
  "other_driver",
  "unordered_motion",
]);

// In these a person has to look at it, and let it move.
const WAITING_STATES = new Set(["stopped", "disarmed", "away"]);
const BY_PERSON = new Set(["stopped", "button"]); // reasons that nothing but a person lifts

export class RobotPanel {
  #page;
  #root;
  #trail = [];
  #isConnected = false;
  isStopped = false;
  #status = null;
  #decision = null;
  #breakReason = ""; // why the gesture after that decision did not end as it should
  #pendingOrder = "";
  #orderFailure = "";
  #timer;
  #placing;
  #scene;
  wasStoppedHere = false; // by a tap on this page

  constructor(root, page) {
    this.#root = root;
    this.#page = page;
    this.#scene = new RobotScene(root.querySelector("svg.fill"));
    page.onPress("[data-enlarge]", (button) => this.#enlarge(button));
    page.onPress("[data-robot]", ({ dataset }) => this.order(dataset.robot));
    this.#placing = new RobotPlacing(root.querySelector("[data-placing]"), page.driveRobot);
  }

  reset({ robot, robot_stopped: stopped, presence }) {
    this.#status = robot?.status ?? null;
    this.#decision = robot?.decision ?? null;
    this.#breakReason = "";
    this.isStopped = stopped ?? false;
    this.#isConnected = presence?.robot ?? false;
    this.#orderFailure = "";
    this.#settleOrder();
    this.#keepPose();
  }

  handleEvent(event) {
    if (event.kind === "robot_stopped") {
      this.isStopped = event.stopped;
      this.#orderFailure = "";
      this.#settleOrder();
    }
    if (event.kind === "presence") this.#isConnected = event.presence.robot;
    if (event.kind === "robot") this.#handleReport(event.report);
  }

  #handleReport(report) {
    if (report.kind === "status") this.#status = report;
    if (report.kind === "decision") {
      this.#decision = report;
      this.#breakReason = "";
    }
    const isBroken = report.kind === "gesture" && report.phase === "ended" && report.outcome !== "done";
    if (isBroken) this.#breakReason = report.outcome;
    if (report.kind === "incident") this.#linkIncident(report.incident);
    this.#keepPose();
  }

  // Of the last stop; the session's page has all of them.
  #linkIncident(key) {
    const link = this.#root.querySelector("[data-incident]");
    link.href = link.dataset.incident.replace("/0/", `/${key}/`);
    link.hidden = false;
  }

  #keepPose() {
    const pose = this.#status?.pose;
    if (!pose) return;
    this.#trail.push(pose);
    if (this.#trail.length > KEPT_POSES) this.#trail.shift();
  }

  // Show an order as sent while an answer may come; say so when it cannot be sent or is not answered.
  order(order) {
    this.#forgetOrder();
    this.#orderFailure = "";
    this.wasStoppedHere = order === "stop";
    if (this.#page.orderRobot(order)) {
      this.#pendingOrder = order;
      this.#button(order).classList.add("asked");
      this.#timer = setTimeout(() => this.#reportUnanswered(order), order === "stop" ? STOP_MS : ANSWER_MS);
    } else this.#reportUnsent(order);
    this.draw();
  }

  #reportUnanswered(order) {
    const stop = _("The stop did not get through. Use the robot’s own switch.");
    this.#reportFailure(order === "stop" ? stop : _("No answer. Try again."));
  }

  #reportUnsent(order) {
    const stop = _("Not sent: no connection. Use the robot’s own switch.");
    this.#reportFailure(order === "stop" ? stop : _("There is no connection. Try again in a moment."));
  }

  #reportFailure(text) {
    this.#forgetOrder();
    this.#orderFailure = text;
    this.#page.announce(text);
    this.draw();
  }

  #settleOrder() {
    if (this.#pendingOrder && this.isStopped === (this.#pendingOrder === "stop")) this.#forgetOrder();
  }

  #forgetOrder() {
    clearTimeout(this.#timer);
    if (this.#pendingOrder) this.#button(this.#pendingOrder).classList.remove("asked");
    this.#pendingOrder = "";
  }

  #button(order) {
    return document.querySelector(`[data-robot=${order}]`);
  }

  draw() {
    const { show } = this.#page;
    show("robot-state", this.#describeState());
    const isAbsent = this.isStopped && !this.isHere; // nothing to stop any more: plain words
    show("no-robot", isAbsent ? _("No robot here") : "");
    show("robot-stop", this.isStopped ? _("Robot stopped") : _("Stop robot"));
    this.#button("stop").hidden = isAbsent;
    this.#button("stop").classList.toggle("done", this.isStopped || !this.isHere);
    this.#placing.show(this.#isPlaceable, this.#status?.homing != null);
    show("robot-homing", this.#isPlaceable ? describeHoming(this.#status.homing) : "");
    if (!this.#placing.isHeld) this.#drawWords(); // a button that is held stays under its finger
    this.#scene.draw({
      poses: this.#trail,
      lights: this.#status?.lights,
      mood: this.#status?.mood,
      look: this.#status?.look,
    });
  }

  #drawWords() {
    const { show } = this.#page;
    const share = this.#decision?.activated_share;
    const isOther = this.#isHeld || this.#orderFailure || !this.#isConnected; // than what it decides
    show(
      "share",
      share == null || isOther ? "" : fill(_("So far it celebrates %(share)s of the time."), { share: percent(share) }),
    );
    show("robot-why", this.#orderFailure || this.#describeHold());
    show("robot-cure", this.#describeCure());
    show("robot-last", isOther ? "" : describeDecision(this.#decision, this.#breakReason));
    // A real base waits for a person from the start; a stop stays until a person lifts it.
    this.#root.classList.toggle("still", this.#isHeld);
    this.#button("arm").hidden = !this.#isHeld;
    this.#button("arm").disabled = Boolean(whyHeld(this.#page.state.session));
  }

  #enlarge(button) {
    const isLarge = this.#root.classList.toggle("large");
    button.setAttribute("aria-pressed", isLarge);
  }

  // Whether a person may drive it to its mark: a real one that may move, while nobody walks.
  get #isPlaceable() {
    const { simulated, state } = this.#status ?? {};
    const isFree = this.#isConnected && simulated === false && !this.isStopped;
    const isReady = isFree && (state === "away" || !this.#isHeld);
    const { session } = this.#page.state;
    return isReady && session?.state !== "running" && !whyHeld(session);
  }

  // Whether it drove home by its tag, and waits for a person to look.
  get #isBack() {
    const { homing, state } = this.#status ?? {};
    return this.#isConnected && !this.isStopped && homing === "there" && state === "disarmed";
  }

  // Whether it is simulated and stopped itself: it is put back by itself in a moment.
  get #isRecovering() {
    const { state, reason, simulated } = this.#status ?? {};
    return !this.isStopped && simulated === true && state === "stopped" && !BY_PERSON.has(reason);
  }

  // Whether there is one, connected or lost.
  get isHere() {
    return this.#isConnected || this.#page.state.hadRobot;
  }

  // Whether a person has to arm it before it moves.
  get #isHeld() {
    if (this.isStopped) return this.isHere;
    if (this.#isRecovering) return false;
    const { state, reason } = this.#status ?? {};
    return this.#isConnected && (WAITING_STATES.has(state) || reason === "place_unknown");
  }

  #describeState() {
    if (!this.#isConnected) return _("not connected");
    if (this.isStopped) return _("stopped");
    if (!this.#status) return "";
    const { gesture, state } = this.#status;
    return gesture ? `${describeGesture(gesture)}…` : describeState(state);
  }

  #describeHold() {
    const reason = this.#isConnected && this.#status?.reason;
    if (this.#isBack) return describeHoming("there");
    if (this.#isHeld) return fill(_("It is standing still: %(why)s."), { why: describeReason(this.#stopReason) });
    return NOTABLE.has(reason) ? fill(_("It will not move: %(why)s."), { why: describeReason(reason) }) : "";
  }

  #describeCure() {
    if (this.#isBack) return this.#describeBattery();
    const parts = [this.#cureOf(this.#isHeld ? this.#stopReason : this.#status?.reason), this.#describeBattery()];
    if (this.#isHeld) parts.push(_("Put it on its mark with nobody near it, then:"));
    return parts.filter(Boolean).join(" ");
  }

  // Whether it asks to be charged, before it has to stop for that.
  #describeBattery() {
    const { battery_low: isLow, battery_share: share, reason } = this.#status ?? {};
    if (!this.#isConnected || !isLow || reason === "charging") return "";
    const words = _("“Charge me”: battery %(share)s. It stands on its mark after each gesture; carry it from there.");
    return fill(words, { share: percent(share ?? 0) });
  }

  // Return why it stands although somebody walks, with the cure; "" where it does not.
  get alarm() {
    if (!this.#isConnected || this.#isRecovering) return "";
    if (!this.isStopped && this.#status?.state !== "stopped") return "";
    const why = fill(_("The robot is standing still: %(why)s."), { why: describeReason(this.#stopReason) });
    return [why, this.cure].filter(Boolean).join(" ");
  }

  // Return what to do before it may move again; "" where nothing is known.
  get cure() {
    return this.#cureOf(this.#stopReason);
  }

  get isSimulated() {
    return this.#status?.simulated === true;
  }

  // Return what to do about a reason: a simulated robot has no cable to check.
  #cureOf(reason) {
    const cure = cureOf(reason);
    return cure && this.isSimulated ? _("It is simulated: let it move again.") : cure;
  }

  // The server remembers why the robot stopped by itself, also where its program was restarted since.
  get #stopReason() {
    const known = this.isStopped && this.#page.state.session?.stop_reason;
    return known || this.#status?.reason || "stopped";
  }

  // Return [sign, text] of whether it may take part.
  get readiness() {
    if (!this.#isConnected) return ["–", _("No robot")];
    if (this.#isHeld) return ["!", _("Robot stopped: first let it move again, in its panel")];
    return this.connection.isLow ? ["!", `${_("Robot")}: ${this.connection.text}`] : ["✓", _("Robot")];
  }

  // Return its line among those who are connected; `isLow` asks for a look.
  get connection() {
    if (!this.#isConnected) return { text: _("none"), isLow: false };
    if (this.#isHeld) return { text: this.#describeState(), isLow: true };
    const { battery_share: share, battery_low: low, simulated, open_loop: open, bumpers } = this.#status ?? {};
    const lacks =
      simulated === false ? `${open ? _(", cannot tell where it is") : ""}${bumpers ? "" : _(", no bumper")}` : "";
    if (share == null) return { text: _("connected") + lacks, isLow: false };
    const battery = fill(_("battery %(share)s"), { share: percent(share) });
    return { text: battery + (low ? _(": charge it") : "") + lacks, isLow: Boolean(low) };
  }
}
