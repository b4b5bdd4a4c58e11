// The robot on the PT's page: where it is, what it does, why it did or did not move, and its stop.

const KEPT = 240; // positions of the trail
const REASONS = {
  no_gesture: "no gesture for that",
  late: "the steps came late",
  performing: "still moving",
  resting: "resting",
  unknown_gesture: "it does not know the gesture",
  base_cannot_move: "this base does not move",
  stopped: "stopped",
  disarmed: "not armed",
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
  firmware_unknown: "the base's version is not known yet",
  firmware_refused: "the base's version is too old",
};
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
    this.stopped = stopped ?? false;
    this.there = presence?.robot ?? false;
    this.#follow();
  }

  take(event) {
    if (event.kind === "robot_stopped") this.stopped = event.stopped;
    if (event.kind === "presence") this.there = event.presence.robot;
    if (event.kind !== "robot") return;
    if (event.report.kind === "status") this.status = event.report;
    if (event.report.kind === "decision") this.decision = event.report;
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
    this.show("robot-state", !this.there ? "not connected" : !status ? "" : stopped ? "stopped" : status.gesture ? `${status.gesture}…` : (STATES[status.state] ?? status.state));
    this.show("share", decision?.activated_share == null ? "" : `in ${Math.round(100 * decision.activated_share)} % of windows`);
    const still = stopped || ["stopped", "disarmed"].includes(status?.state);
    this.show("robot-why", still && status?.reason ? `It stands: ${REASONS[status.reason] ?? status.reason}.` : why(decision));
    // A real base waits for a person from the start; a stop stays until a person lifts it.
    const [stop, arm] = this.root.querySelectorAll("[data-robot]");
    stop.hidden = stopped;
    arm.hidden = !still;
    (stopped ? stop : arm).classList.remove("asked");
    this.#drawWay();
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

function why(decision) {
  if (!decision) return "Decides every five seconds of walking.";
  const { mean, threshold, above, gesture, reason } = decision;
  const compared = `${Math.round(100 * mean)} % is ${above ? "at or above" : "below"} ${Math.round(100 * threshold)} %`;
  return `${compared}: ${gesture ?? REASONS[reason] ?? reason}.`;
}
