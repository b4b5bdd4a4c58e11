// What the PT's page knows of its session: the server's snapshot, kept current by events. Nothing is computed here.

// After which a sensor or tablet counts as silent; a tablet is heard at every heartbeat, 5 s.
export const SILENT_S = { stride: 4, tablet: 8 };
const KEPT_STRIDES = 400;
const TOTALS = ["hit_rate", "hits", "judged", "score"];
const TIMES = ["active_s", "phase_s", "phase_strides"];
const TYPES = ["began", "changed_to", "valence", "next_valence", "types"];
// What of the session each kind of event tells.
const TOLD = {
  goal: ["goal"],
  gain: ["gain"],
  valence: TYPES,
  state: ["state", "pause_reason", "rest_s"],
  phase: ["phase", "goal", "gain", "obstacle", ...TIMES, ...TYPES],
};

// Copy those of the named fields that an event has.
export function update(target, event, names) {
  for (const name of names) if (event[name] !== undefined) target[name] = event[name];
}

export const hasStarted = ({ state }) => state === "running" || state === "paused";

// A remark as charts show it: after a stride.
export const annotationOf = ({ number, what, value }) => ({ after: number, kind: what, value });

export class MonitorState {
  session = null; // the last snapshot, brought up to date by events
  strides = [];
  annotations = []; // changes and remarks, each after a stride
  lastStride = null;
  fellHereAt = null; // when a fall was tapped on this page, until it is seen or taken back
  hadTablet = false; // since the start, or shortly before it
  hadRobot = false;
  #snapshotAt = 0;
  #presenceAt = 0;
  #runningAt = null;

  reset(snapshot) {
    this.session = snapshot;
    this.strides = snapshot.steps.slice(-KEPT_STRIDES);
    this.annotations = snapshot.marks;
    this.lastStride ??= this.strides.at(-1) ?? null;
    if (!snapshot.alarms.some(({ kind }) => kind === "fall")) this.fellHereAt = null; // answered meanwhile
    this.#snapshotAt = this.#presenceAt = performance.now();
    this.#keepRunning();
    this.#keepDevices();
  }

  // Add strides that were walked while the connection was lost.
  addMissed(strides) {
    const known = new Set(this.strides.map(({ number }) => number));
    const missed = strides.filter(({ number }) => !known.has(number));
    this.strides = [...this.strides, ...missed].sort((a, b) => a.number - b.number).slice(-KEPT_STRIDES);
  }

  apply(event) {
    update(this.session, event, TOLD[event.kind] ?? []);
    if (event.mark) this.annotations.push(event.mark);
    if (event.kind === "remark") this.annotations.push(annotationOf(event));
    if (event.kind === "step") this.#addStride(event);
    if (event.kind === "presence") {
      this.session.presence = event.presence;
      this.#presenceAt = performance.now();
    }
    this.#keepDevices();
  }

  // Keep which devices have been there: those that were not cannot be lost.
  #keepDevices() {
    const { presence } = this.session;
    const isOn = hasStarted(this.session);
    this.hadTablet = (isOn && this.hadTablet) || presence.tablets > 0;
    this.hadRobot = (isOn && this.hadRobot) || presence.robot;
  }

  // Keep since when it runs, as far as this page has seen it.
  #keepRunning() {
    if (this.session.state !== "running") this.#runningAt = null;
    else this.#runningAt ??= performance.now();
  }

  #addStride(event) {
    const { session } = this;
    update(session, event, TIMES);
    session.number = event.number;
    if (event.side !== session.trained_side) return;
    update(session, event, TOTALS);
    this.strides.push(event);
    if (this.strides.length > KEPT_STRIDES) this.strides.shift();
    if (event.live) this.lastStride = event;
    const { tablet_ago_s: tablet } = session.presence;
    session.presence.stride_ago_s = 0;
    session.presence.tablet_ago_s = tablet == null ? null : tablet + this.sincePresence_s;
    this.#presenceAt = performance.now();
  }

  // Seconds since it was started or resumed.
  get sinceRunning_s() {
    this.#keepRunning();
    return this.#runningAt === null ? 0 : (performance.now() - this.#runningAt) / 1000;
  }

  // Seconds since a fall was tapped here.
  get sinceFell_s() {
    return this.fellHereAt === null ? Infinity : (performance.now() - this.fellHereAt) / 1000;
  }

  // Seconds since the last stride and since the tablet was heard; null for never.
  get strideAgo_s() {
    return this.#ago(this.session.presence.stride_ago_s);
  }
  get tabletAgo_s() {
    return this.#ago(this.session.presence.tablet_ago_s);
  }

  get isTabletHeard() {
    return this.session.presence.tablets > 0 && !(this.tabletAgo_s > SILENT_S.tablet);
  }

  #ago(seconds) {
    return seconds == null ? null : seconds + this.sincePresence_s;
  }

  // Seconds since this page connected.
  get sinceSnapshot_s() {
    return (performance.now() - this.#snapshotAt) / 1000;
  }

  // Seconds since the server said who is connected.
  get sincePresence_s() {
    return (performance.now() - this.#presenceAt) / 1000;
  }
}
