// Sends strides by the protocol of sources (docs/protocol.md): numbered, stored until acknowledged, sent again.

import { ServerClock } from "garry/sensor/clock";

const FIRST_PAUSE_MS = 500;
const LONGEST_PAUSE_MS = 5_000;
const ANSWER_MS = 8_000; // after which a connection that owes an answer is dead
const FIRST_QUESTIONS = 8; // for the server's time
const QUESTION_MS = [250, 15_000]; // between the first ones, and later
const MOST = 80; // steps that are not acknowledged; so many fill half of the largest frame
const FINAL = new Map([
  [4001, "unauthorized"],
  [4009, "replaced"],
  [4400, "refused"],
]);

const now_s = () => (performance.timeOrigin + performance.now()) / 1000;

export class Sender {
  #path;
  #token;
  #journal;
  #run = null; // { run, session, last }
  #waiting = []; // strides that are not acknowledged, by number
  #sent = 0; // up to which number, over this connection
  #socket = null;
  #isAnswered = false; // the hello
  #isWelcome = false; // in a session
  #heard_ms = 0; // when the server last said something, or was first asked
  #pause_ms = FIRST_PAUSE_MS;
  #about = { trouble: "" };
  #side;
  #isCompanion = false; // on the leg that is not trained: its contacts alone are sent
  #onState;
  #questions = 0; // over this connection:
  #asked = null;
  clock = new ServerClock();
  onContact = () => {}; // of the other leg's phone
  state = "ready"; // of the session

  // `onState(state, message)`: "connected", "other leg", "lost", "no session", "ended" (the session), or why it ends:
  // a value of FINAL.
  constructor(path, token, side, journal, onState) {
    this.#path = path;
    this.#side = side;
    this.#token = token;
    this.#journal = journal;
    this.#onState = onState;
  }

  get waiting() {
    return this.#waiting.length;
  }

  async open() {
    const { run, strides } = await this.#journal.read();
    this.#run = run ?? { run: crypto.randomUUID(), session: null, last: 0 };
    this.#waiting = strides;
    this.#connect();
    setInterval(() => this.#watch(), 1_000);
  }

  // Send when this leg met the floor, for the phone on the leg that is trained.
  #sendContact({ end_s }) {
    const error_s = this.clock.error_s(now_s());
    if (!this.#isWelcome || this.state !== "running" || !Number.isFinite(error_s)) return;
    this.#send({ type: "contact", at_s: this.clock.toServer(end_s), error_s });
  }

  // Number a stride and store it, while a session takes strides. Returns whether it did.
  async put(stride) {
    if (this.#isCompanion) {
      if (!stride.reasons.length) this.#sendContact({ end_s: stride.time_s });
      return false;
    }
    if (this.#run?.session == null || !["running", "paused"].includes(this.state)) return false;
    this.#run.last += 1;
    const numbered = { number: this.#run.last, ...stride };
    if (this.state === "paused") numbered.reasons = [...stride.reasons, "paused"];
    this.#waiting.push(numbered);
    await this.#journal.add({ ...this.#run }, numbered);
    this.#flush();
    return true;
  }

  // `about`: { trouble, rate_hz, plays, round }.
  say(about) {
    this.#about = about;
    const error_s = this.clock.error_s(now_s());
    const clock = Number.isFinite(error_s) ? { clock_offset_s: this.clock.offset_s, clock_error_s: error_s } : {};
    if (this.#isWelcome) this.#send({ type: "sensor", ...about, ...clock });
  }

  #askTime(socket) {
    if (socket !== this.#socket) return;
    this.#send({ type: "clock", asked_s: now_s() });
    this.#questions += 1;
    setTimeout(() => this.#askTime(socket), QUESTION_MS[Number(this.#questions >= FIRST_QUESTIONS)]);
  }

  #connect() {
    const url = new URL(this.#path, location.href);
    url.protocol = url.protocol.replace("http", "ws");
    const own = (this.#socket = new WebSocket(url));
    this.#heard_ms = performance.now();
    own.onopen = () => {
      const { run, last } = this.#run;
      this.#send({ type: "hello", version: 1, token: this.#token, run, last, clock_s: now_s(), side: this.#side });
    };
    own.onmessage = ({ data }) => {
      this.#heard_ms = performance.now();
      if (own === this.#socket) this.#receive(JSON.parse(data));
    };
    own.onclose = ({ code }) => own === this.#socket && this.#lose(code);
  }

  #lose(code) {
    this.#socket = null;
    this.#isAnswered = this.#isWelcome = false;
    if (FINAL.has(code)) {
      this.#onState(FINAL.get(code), this.problem);
      return;
    }
    this.#onState("lost");
    setTimeout(() => this.#connect(), this.#pause_ms);
    this.#pause_ms = Math.min(2 * this.#pause_ms, LONGEST_PAUSE_MS);
  }

  // A network that is gone closes nothing: what is not answered in time is lost.
  #watch() {
    const socket = this.#socket;
    const isOwed = !this.#isAnswered || this.#waiting.some(({ number }) => number <= this.#sent);
    if (!socket || !isOwed || performance.now() - this.#heard_ms < ANSWER_MS) return;
    this.#lose();
    socket.close();
  }

  async #receive(message) {
    switch (message.type) {
      case "welcome":
        await this.#join(message);
        break;
      case "clock":
        this.clock.answer(message.asked_s, message.at_s, now_s());
        if (this.#questions === FIRST_QUESTIONS || this.#questions % 4 === 0) this.say(this.#about);
        break;
      case "contact":
        this.onContact(message);
        break;
      case "ack":
        this.#waiting = this.#waiting.filter(({ number }) => number > message.number);
        await this.#journal.acknowledge(message.number);
        this.#flush();
        break;
      case "start":
      case "resume":
        this.state = "running";
        break;
      case "pause":
        this.state = "paused";
        break;
      case "stop":
        this.state = "finished";
        this.#onState("ended");
        break;
      case "error":
        this.problem = message.message;
        break;
    }
  }

  async #join({ session, state, next, is_companion: companion }) {
    this.#pause_ms = FIRST_PAUSE_MS;
    this.#isAnswered = true;
    const wasWalking = ["running", "paused"].includes(this.state);
    this.state = state;
    if (session === null) {
      this.#onState(wasWalking ? "ended" : "no session"); // which it may not have heard while it was lost
      return;
    }
    if (this.#asked !== this.#socket) {
      this.#asked = this.#socket;
      this.#questions = 0;
      this.#askTime(this.#asked);
    }
    this.#isCompanion = Boolean(companion);
    if (this.#isCompanion) {
      this.#isWelcome = true;
      this.#onState("other leg");
      this.say(this.#about);
      return;
    }
    if (this.#run.session !== session) {
      // Another session: what an earlier one did not take belongs to no other.
      this.#run = { run: this.#run.run, session, last: next - 1 };
      this.#waiting = [];
      await this.#journal.begin({ ...this.#run });
    } else if (next > this.#run.last + 1) {
      this.#run.last = next - 1; // another source has numbered since
    }
    this.#waiting = this.#waiting.filter(({ number }) => number >= next);
    this.#sent = next - 1;
    this.#isWelcome = true;
    this.#onState("connected");
    this.say(this.#about);
    this.#flush();
  }

  #flush() {
    if (!this.#isWelcome) return;
    const isIdle = !this.#waiting.some(({ number }) => number <= this.#sent);
    if (isIdle) this.#heard_ms = performance.now();
    const due = this.#waiting.slice(0, MOST).filter(({ number }) => number > this.#sent);
    if (!due.length) return;
    this.#sent = due[due.length - 1].number;
    this.#send({ type: "steps", steps: due });
  }

  #send(message) {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(message));
  }
}
