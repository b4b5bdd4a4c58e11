// A session's log, played: tells each page that joins what it was told then, up to the moment that is shown.
//
// `log` is made by rehab/sessions/reports/replay.py. A moment is counted, not only timed: several can have one time.

const AT_S = 0;
const NUMBER = 1;
const COLUMNS = { patient: 2, monitor: 3 };

export class Player {
  #log;
  #members = [];
  #onMove;
  #frame = 0;
  #drawnAt = 0;
  count = 0; // of the moments that have been
  at_s = 0;
  speed = 1;

  // `onMove`: called whenever another moment is shown, or it begins or ends to play.
  constructor(log, onMove) {
    this.#log = log;
    this.#onMove = onMove;
  }

  get took_s() {
    return this.#log.took_s;
  }

  get isPlaying() {
    return this.#frame !== 0;
  }

  // The index of each step of the trained leg among the moments.
  get #steps() {
    const side = this.#log.snapshots.monitor.trained_side;
    const isStep = (event) => event?.kind === "step" && event.side === side;
    return [...this.#log.moments.keys()].filter((index) => isStep(this.#log.moments[index][COLUMNS.monitor]));
  }

  // Tell a page of an audience what it was told, from now on; returns how it waits.
  join(audience, handlers) {
    const member = { audience, handlers, count: 0, at_s: Infinity, due: null };
    this.#members.push(member);
    queueMicrotask(() => this.#follow(member)); // as a socket: it has returned before it tells anything
    const after = (ms, act) => {
      const due = (member.due = { at_s: member.at_s + ms / 1000, act });
      return () => {
        if (member.due === due) member.due = null;
      };
    };
    return { after };
  }

  // Show a moment by its time.
  moveTo(at_s) {
    const wanted_s = Math.min(Math.max(0, at_s), this.took_s);
    const next = this.#log.moments.findIndex((moment) => moment[AT_S] > wanted_s);
    this.#show(next < 0 ? this.#log.moments.length : next, wanted_s);
  }

  // Show a stride by its number; the first one after it where there is none.
  moveToStride(number) {
    const index = this.#steps.find((step) => this.#log.moments[step][NUMBER] >= number);
    if (index !== undefined) this.#showStep(index);
  }

  // Show the next stride, or the one before.
  step(by) {
    this.pause();
    if (by > 0) {
      const next = this.#steps.find((index) => index >= this.count);
      if (next === undefined) this.#show(this.#log.moments.length, this.took_s);
      else this.#showStep(next);
      return;
    }
    const shown = this.#steps.filter((index) => index < this.count);
    if (shown.length > 1) this.#showStep(shown.at(-2));
    else this.#show(0, 0);
  }

  #showStep(index) {
    this.#show(index + 1, this.#log.moments[index][AT_S]);
  }

  #show(count, at_s) {
    this.count = count;
    this.at_s = at_s;
    for (const member of this.#members) this.#follow(member);
    this.#onMove();
  }

  #follow(member) {
    const { handlers } = member;
    if (this.count < member.count || this.at_s < member.at_s) {
      Object.assign(member, { count: 0, at_s: 0, due: null });
      handlers.onLink?.("open");
      handlers.onSnapshot?.(structuredClone(this.#log.snapshots[member.audience]));
    }
    while (member.count < this.count) {
      const moment = this.#log.moments[member.count++];
      this.#wait(member, moment[AT_S]);
      const event = moment[COLUMNS[member.audience]];
      if (event) handlers.onEvent?.(event);
    }
    this.#wait(member, this.at_s);
  }

  // Let time pass for a page, and do what it waits for.
  #wait(member, at_s) {
    member.at_s = at_s;
    if (!member.due || member.due.at_s > at_s) return;
    const { act } = member.due;
    member.due = null;
    act();
  }

  play() {
    if (this.at_s >= this.took_s) this.#show(0, 0);
    this.#drawnAt = performance.now();
    const go = (now) => {
      const passed_s = Math.max(0, now - this.#drawnAt) / 1000;
      this.#drawnAt = now;
      this.#frame = requestAnimationFrame(go);
      if (this.at_s >= this.took_s) this.pause();
      else this.moveTo(this.at_s + passed_s * this.speed);
    };
    this.#frame = requestAnimationFrame(go);
    this.#onMove();
  }

  pause() {
    cancelAnimationFrame(this.#frame);
    this.#frame = 0;
    this.#onMove();
  }
}
