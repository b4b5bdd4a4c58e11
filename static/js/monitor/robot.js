// The robot on the PT's page: where it is, what it does, why it did or did not move, and its stop.

import { _, fill, number } from "garry/shared/language";

const KEPT = 240; // positions of the trail
const ANSWER_MS = 2_000; // after which a link that nobody has closed is not believed
// Why it does not move, or did not end what it began.
const REASONS = {
  no_gesture: _("no gesture for that"),
  off: _("the robot is off"),
  late: _("the steps came late"),
  performing: _("still moving"),
  resting: _("resting"),
  unknown_gesture: _("it does not know the gesture"),
  bad_gesture: _("it cannot perform the gesture; compose it anew"),
  base_cannot_move: _("this base does not move"),
  stopped: _("somebody stopped it"),
  disarmed: _("nobody has let it move yet"),
  away_from_home: _("away from its place"),
  no_session: _("no session"),
  not_running: _("the session does not run"),
  unwatched: _("no therapist's page is open"),
  base_silent: _("the base does not answer"),
  order_lapsed: _("the order came too late"),
  battery_low: _("its battery is low"),
  battery_empty: _("its battery is empty"),
  charging: _("it is charging"),
  bump: _("it bumped into something"),
  cliff: _("there is an edge"),
  wheel_drop: _("a wheel hangs free"),
  over_current: _("a wheel is blocked"),
  stalled: _("a wheel is blocked"),
  tether: _("it left its place"),
  slipped: _("it slipped"),
  button: _("its stop button was pressed"),
  restarted: _("the base was restarted"),
  nobody_listens: _("no driver listens to it"),
  feeler_missing: _("what should feel for it is not there"),
  other_driver: _("another program drives it"),
  open_loop: _("too long for a base that does not tell where it is"),
  place_unknown: _("nobody has looked for long whether it is at its place"),
  firmware_unknown: _("the base's version is not known yet"),
  firmware_refused: _("the base's version is too old"),
  paused: _("the session paused"),
  finished: _("the session ended"),
  aborted: _("the session ended"),
  out_of_time: _("it did not get there in time"),
  bad_odometry: _("it does not know where it is"),
  no_link: _("the connection was lost"),
  replaced: _("another session began"),
};
// What has to be done before it may move again.
const CURES = {
  bump: _("Clear its way."),
  cliff: _("Take it away from the edge."),
  wheel_drop: _("Put it down on both wheels."),
  over_current: _("Free its wheels."),
  stalled: _("Free its wheels."),
  slipped: _("Look at the floor and its wheels."),
  base_silent: _("Look at its switch and its cable."),
  charging: _("Take it off the charger."),
  battery_low: _("Charge it."),
  battery_empty: _("Charge it."),
  button: _("Let go of its button."),
  nobody_listens: _("Start its driver."),
  feeler_missing: _("Start its driver."),
  other_driver: _("Stop the other program."),
};
// Of the reasons in its status, those that are no matter of course.
const HOLDS = new Set([
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
  "other_driver",
]);
const STATES = { idle: _("waiting"), performing: _("moving"), stopped: _("stopped"), disarmed: _("not armed") };

export class RobotPanel {
  // `send(order)` gives whether it could be sent; `tell(words)` says so to whoever looks elsewhere.
  constructor(root, show, send, tell) {
    this.root = root;
    this.show = show;
    this.send = send;
    this.tell = tell;
    this.way = [];
    this.begin({});
  }

  begin({ robot, robot_stopped: stopped, presence }) {
    this.status = robot?.status ?? null;
    this.decision = robot?.decision ?? null;
    this.brokenOff = ""; // why the gesture after that decision did not end as it should
    this.stopped = stopped ?? false;
    this.there = presence?.robot ?? false;
    this.unheard = "";
    this.#settle();
    this.#follow();
  }

  take(event) {
    if (event.kind === "robot_stopped") {
      this.stopped = event.stopped;
      this.unheard = "";
      this.#settle();
    }
    if (event.kind === "presence") this.there = event.presence.robot;
    if (event.kind !== "robot") return;
    if (event.report.kind === "status") this.status = event.report;
    if (event.report.kind === "decision") [this.decision, this.brokenOff] = [event.report, ""];
    if (event.report.kind === "gesture" && event.report.phase === "ended" && event.report.outcome !== "done")
      this.brokenOff = event.report.outcome;
    this.#follow();
  }

  // An order looks heard only while it may be: one that cannot be sent, or is not answered, says so.
  order(order) {
    this.#drop();
    this.unheard = "";
    if (this.send(order)) {
      this.asked = order;
      this.#button(order).classList.add("asked");
      this.timer = setTimeout(
        () => this.#miss(order, _("No answer. If the robot moves, use its own switch."), _("No answer. Try again.")),
        ANSWER_MS,
      );
    } else
      this.#miss(
        order,
        _("Not sent: no connection. Use the robot’s own switch."),
        _("There is no connection. Try again in a moment."),
      );
    this.draw();
  }

  #miss(order, stop, other) {
    this.#drop();
    this.unheard = order === "stop" ? stop : other;
    this.tell(this.unheard);
    this.draw();
  }

  #settle() {
    if (this.asked && this.stopped === (this.asked === "stop")) this.#drop();
  }

  #drop() {
    clearTimeout(this.timer);
    if (this.asked) this.#button(this.asked).classList.remove("asked");
    this.asked = "";
  }

  #button(order) {
    return this.root.querySelector(`[data-robot=${order}]`);
  }

  #follow() {
    const pose = this.status?.pose;
    if (!pose) return;
    this.way.push(pose);
    if (this.way.length > KEPT) this.way.shift();
  }

  draw() {
    const { status, decision, stopped, unheard } = this;
    const still =
      stopped ||
      (this.there && (["stopped", "disarmed"].includes(status?.state) || status?.reason === "place_unknown"));
    this.root.classList.toggle("still", still);
    this.show(
      "robot-state",
      !this.there
        ? _("not connected")
        : !status
          ? ""
          : stopped
            ? _("stopped")
            : status.gesture
              ? `${status.gesture}…`
              : (STATES[status.state] ?? status.state),
    );
    this.show(
      "share",
      decision?.activated_share == null
        ? ""
        : fill(_("%(share)s of windows"), { share: percent(decision.activated_share) }),
    );
    this.show(
      "robot-why",
      unheard
        ? unheard
        : still
          ? fill(_("It stands: %(why)s."), { why: say((this.there && status?.reason) || "stopped") })
          : this.there && HOLDS.has(status?.reason)
            ? fill(_("It would not move: %(why)s."), { why: say(status.reason) })
            : "",
    );
    this.show(
      "robot-cure",
      still
        ? `${CURES[status?.reason] ?? ""} ${_("Put it on its mark, nobody near it, then:")}`.trim()
        : (CURES[status?.reason] ?? ""),
    );
    this.show("robot-last", still || unheard ? "" : this.#last());
    // A real base waits for a person from the start; a stop stays until a person lifts it.
    const [stop, arm] = this.root.querySelectorAll("[data-robot]");
    stop.hidden = stopped;
    arm.hidden = !still;
    this.#drawWay();
  }

  // What the last window came to, and what followed.
  #last() {
    if (!this.decision) return _("Decides every five seconds of walking.");
    const { mean, threshold, gesture, intensity, reason } = this.decision;
    const size = intensity == null || intensity === 1 ? "" : fill(_(" at %(share)s"), { share: percent(intensity) });
    const broken = this.brokenOff && fill(_(", broken off: %(why)s"), { why: say(this.brokenOff) });
    return fill(_("Last window %(mean)s, acts from %(threshold)s: %(what)s."), {
      mean: percent(mean),
      threshold: percent(threshold),
      what: gesture ? gesture + size + broken : say(reason),
    });
  }

  // What stands beside the robot among those who are there; `low` asks for a charger.
  get presence() {
    const { battery_share: share, battery_low: low, simulated, open_loop: open, bumpers } = this.status ?? {};
    if (!this.there) return { words: _("none"), low: false };
    const lacks = simulated === false ? `${open ? _(", open loop") : ""}${bumpers ? "" : _(", no bumper")}` : "";
    if (share == null) return { words: _("connected") + lacks, low: false };
    return {
      words: fill(_("battery %(share)s"), { share: percent(share) }) + (low ? _(": charge it") : "") + lacks,
      low: Boolean(low),
    };
  }

  // The robot's own frame: home in the middle, ahead is up; 1.5 m wide.
  #drawWay() {
    const svg = this.root.querySelector("svg");
    const at = ({ x_m: x, y_m: y }) => `${(-y).toFixed(3)} ${(-x).toFixed(3)}`;
    const here = this.way.at(-1);
    let drawing =
      '<circle class="home-spot" r="0.18"/><path class="scale" d="M-0.7 0.44h0.5M-0.7 0.41v0.06M-0.2 0.41v0.06"/><text class="scale-words" x="-0.45" y="0.39">' +
      number(0.5, 1) +
      " m</text>";
    if (this.way.length > 1) drawing += `<path class="way" d="M${this.way.map(at).join("L")}"/>`;
    if (here) {
      const degrees = (-here.heading_rad * 180) / Math.PI;
      drawing += `<g transform="translate(${at(here)}) rotate(${degrees.toFixed(1)})"><circle class="base" r="0.175"/><path class="nose" d="M0 -0.04V-0.14"/></g>`;
    }
    svg.innerHTML = drawing;
  }
}

const percent = (share) => `${number(100 * share)}\u00a0%`;
const say = (reason) => REASONS[reason] ?? reason;
