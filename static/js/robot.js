// The robot on the PT's page: where it is, what it does, why it did or did not move, and its stop.

const KEPT = 240; // positions of the trail
// Why it does not move, or did not end what it began.
const REASONS = {
  no_gesture: "no gesture for that",
  off: "the robot is off",
  late: "the steps came late",
  performing: "still moving",
  resting: "resting",
  unknown_gesture: "it does not know the gesture",
  other_driver: "something else drives it too",
  nobody_listens: "nobody follows its orders",
  feeler_missing: "its odometry or its bumpers are missing",
  open_loop: "the gesture is too long for a base that cannot tell where it is",
  place_unknown: "nobody has looked where it stands for long",
  bad_gesture: "it cannot perform the gesture; compose it anew",
  base_cannot_move: "this base does not move",
  stopped: "somebody stopped it",
  disarmed: "nobody has let it move yet",
  away_from_home: "away from its place",
  no_session: "no session",
  not_running: "the session does not run",
  unwatched: "no therapist's page is open",
  base_silent: "the base does not answer",
  order_lapsed: "the order came too late",
  battery_low: "its battery is low",
  battery_empty: "its battery is empty",
  charging: "it is charging",
  bump: "it bumped into something",
  cliff: "there is an edge",
  wheel_drop: "a wheel hangs free",
  over_current: "a wheel is blocked",
  stalled: "a wheel is blocked",
  tether: "it left its place",
  slipped: "it slipped",
  button: "its stop button was pressed",
  restarted: "the base was restarted",
  nobody_listens: "no driver listens to it",
  feeler_missing: "what should feel for it is not there",
  other_driver: "another program drives it",
  open_loop: "too long for a base that does not tell where it is",
  place_unknown: "nobody has looked for long whether it is at its place",
  firmware_unknown: "the base's version is not known yet",
  firmware_refused: "the base's version is too old",
  paused: "the session paused",
  finished: "the session ended",
  aborted: "the session ended",
  out_of_time: "it did not get there in time",
  bad_odometry: "it does not know where it is",
  no_link: "the connection was lost",
  replaced: "another session began",
};
// What has to be done before it may move again.
const CURES = {
  bump: "Clear its way.",
  cliff: "Take it away from the edge.",
  wheel_drop: "Put it down on both wheels.",
  over_current: "Free its wheels.",
  stalled: "Free its wheels.",
  slipped: "Look at the floor and its wheels.",
  base_silent: "Look at its switch and its cable.",
  other_driver: "Stop what else drives it.",
  nobody_listens: "Look at its own computer.",
  feeler_missing: "Look at its own computer.",
  charging: "Take it off the charger.",
  battery_low: "Charge it.",
  battery_empty: "Charge it.",
  button: "Let go of its button.",
  nobody_listens: "Start its driver.",
  feeler_missing: "Start its driver.",
  other_driver: "Stop the other program.",
};
// Of the reasons in its status, those that are no matter of course.
const HOLDS = new Set(["unwatched", "charging", "battery_low", "away_from_home", "base_silent", "firmware_unknown", "firmware_refused", "bump", "cliff", "wheel_drop", "over_current", "button", "nobody_listens", "feeler_missing", "other_driver"]);
const STATES = { idle: "waiting", performing: "moving", stopped: "stopped", disarmed: "not armed" };

export class RobotPanel {
  constructor(root, show, send) {
    this.root = root;
    this.show = show;
    this.send = send;
    this.way = [];
    this.begin({});
  }

  begin({ robot, robot_stopped: stopped, presence }) {
    this.status = robot?.status ?? null;
    this.decision = robot?.decision ?? null;
    this.brokenOff = ""; // why the gesture after that decision did not end as it should
    this.stopped = stopped ?? false;
    this.there = presence?.robot ?? false;
    this.#follow();
  }

  take(event) {
    if (event.kind === "robot_stopped") this.stopped = event.stopped;
    if (event.kind === "presence") this.there = event.presence.robot;
    if (event.kind !== "robot") return;
    if (event.report.kind === "status") this.status = event.report;
    if (event.report.kind === "decision") [this.decision, this.brokenOff] = [event.report, ""];
    if (event.report.kind === "gesture" && event.report.phase === "ended" && event.report.outcome !== "done") this.brokenOff = event.report.outcome;
    this.#follow();
  }

  order(order) {
    this.root.querySelector(`[data-robot=${order}]`).classList.add("asked");
    this.send(order);
  }

  #follow() {
    const pose = this.status?.pose;
    if (!pose) return;
    this.way.push(pose);
    if (this.way.length > KEPT) this.way.shift();
  }

  draw() {
    const { status, decision, stopped } = this;
    const still = stopped || (this.there && (["stopped", "disarmed"].includes(status?.state) || status?.reason === "place_unknown"));
    this.root.classList.toggle("still", still);
    this.show("robot-state", !this.there ? "not connected" : !status ? "" : stopped ? "stopped" : status.gesture ? `${status.gesture}…` : (STATES[status.state] ?? status.state));
    this.show("share", decision?.activated_share == null ? "" : `${percent(decision.activated_share)} of windows`);
    this.show("robot-why", still ? `It stands: ${say((this.there && status?.reason) || "stopped")}.` : this.there && HOLDS.has(status?.reason) ? `It would not move: ${say(status.reason)}.` : "");
    this.show("robot-cure", still ? `${CURES[status?.reason] ?? ""} Put it on its mark, nobody near it, then:`.trim() : CURES[status?.reason] ?? "");
    this.show("robot-last", still ? "" : this.#last());
    // A real base waits for a person from the start; a stop stays until a person lifts it.
    const [stop, arm] = this.root.querySelectorAll("[data-robot]");
    stop.hidden = stopped;
    arm.hidden = !still;
    (stopped ? stop : arm).classList.remove("asked");
    this.#drawWay();
  }

  // What the last window came to, and what followed.
  #last() {
    if (!this.decision) return "Decides every five seconds of walking.";
    const { mean, threshold, gesture, intensity, reason } = this.decision;
    const size = intensity == null || intensity === 1 ? "" : ` at ${percent(intensity)}`;
    const broken = this.brokenOff && `, broken off: ${say(this.brokenOff)}`;
    return `Last window ${percent(mean)}, acts from ${percent(threshold)}: ${gesture ? gesture + size + broken : say(reason)}.`;
  }

  // What stands beside the robot among those who are there; `low` asks for a charger.
  get presence() {
    const { battery_share: share, battery_low: low, simulated, open_loop: open, bumpers } = this.status ?? {};
    if (!this.there) return { words: "none", low: false };
    const lacks = simulated === false ? `${open ? ", open loop" : ""}${bumpers ? "" : ", no bumper"}` : "";
    if (share == null) return { words: `connected${lacks}`, low: false };
    return { words: `battery ${percent(share)}${low ? ": charge it" : ""}${lacks}`, low: Boolean(low) };
  }

  // The robot's own frame: home in the middle, ahead is up; 1.5 m wide.
  #drawWay() {
    const svg = this.root.querySelector("svg");
    const at = ({ x_m: x, y_m: y }) => `${(-y).toFixed(3)} ${(-x).toFixed(3)}`;
    const here = this.way.at(-1);
    let drawing = '<circle class="home-spot" r="0.18"/><path class="scale" d="M-0.7 0.44h0.5M-0.7 0.41v0.06M-0.2 0.41v0.06"/><text class="scale-words" x="-0.45" y="0.39">0.5 m</text>';
    if (this.way.length > 1) drawing += `<path class="way" d="M${this.way.map(at).join("L")}"/>`;
    if (here) {
      const degrees = (-here.heading_rad * 180) / Math.PI;
      drawing += `<g transform="translate(${at(here)}) rotate(${degrees.toFixed(1)})"><circle class="base" r="0.175"/><path class="nose" d="M0 -0.04V-0.14"/></g>`;
    }
    svg.innerHTML = drawing;
  }
}

const percent = (share) => `${Math.round(100 * share)}\u00a0%`;
const say = (reason) => REASONS[reason] ?? reason;
