// The socket of a session's page: keeps itself connected, gives everything once and in order.
//
//   const live = connect("/ws/session/7/patient/", { onSnapshot, onSteps, onEvent, onLink });
//
// onSnapshot(snapshot): all that the page shows, as of now; after each connection. It replaces what
//   the page knew: totals come from here and from events, never from counting.
// onSteps(steps): past steps that this page has not had, oldest first, after a break.
// onEvent(event): what has just happened.
// onLink(state, why): "open", "lost" (it will come back by itself) or "closed" (it will not; why
//   says so in words).

import { _ } from "garry/language";
import { refusal } from "garry/names";

const wire = JSON.parse(document.getElementById("wire").textContent); // robot/wire/
const SILENCE_MS = 2.4 * wire.heartbeat_ms;
const DOUBT_MS = 1.2 * wire.heartbeat_ms; // after which an old socket is not trusted when the tablet wakes up
const CONFIRM_MS = 50;
const ANSWER_MS = 8_000;
const FIRST_PAUSE_MS = 200;
const LONGEST_PAUSE_MS = 5_000;
const FINAL = new Set(wire.final_codes); // do not retry as it is
const STEPS = new Set(["step", "missing", "calm"]);

export function connect(path, { onSnapshot, onSteps, onEvent, onLink } = {}) {
  const waiting = new Map(); // changes that have not been answered
  let socket, retry, watch, confirming, why;
  let state = "";
  let pause = FIRST_PAUSE_MS;
  let heardAt = 0;
  let had = null; // the last step that this page was given
  let until = null; // steps up to here are being given after a break
  let mark = 0;

  function open() {
    clearTimeout(retry);
    const url = new URL(path, location.href);
    url.protocol = url.protocol.replace("http", "ws");
    if (had !== null) url.searchParams.set("after", had);
    why = null;
    heardAt = performance.now();
    const mine = (socket = new WebSocket(url));
    mine.onmessage = ({ data }) => mine === socket && hear(JSON.parse(data));
    mine.onclose = ({ code }) => mine === socket && lose(code);
    clearInterval(watch);
    watch = setInterval(() => performance.now() - heardAt > SILENCE_MS && drop(), 1_000);
  }

  function hear(message) {
    heardAt = performance.now();
    switch (message.type) {
      case "snapshot":
        pause = FIRST_PAUSE_MS;
        until = message.number;
        if (had === null || had > until) had = until;
        link("open");
        onSnapshot?.(message);
        break;
      case "steps": {
        const missed = message.steps.filter(({ number }) => number > had);
        if (missed.length) {
          had = missed.at(-1).number;
          onSteps?.(missed);
        }
        break;
      }
      case "events":
        caughtUp();
        for (const event of message.events) {
          if (STEPS.has(event.kind)) {
            if (event.number <= had) continue;
            had = event.number;
          }
          onEvent?.(event);
        }
        break;
      case "heartbeat":
        caughtUp();
        confirm(0); // there is a page behind this socket, though it shows nothing new
        if (message.presence) onEvent?.({ kind: "presence", presence: message.presence });
        break;
      case "done":
        answer(message.id);
        break;
      case "error":
        why = refusal(message);
        if (message.id) answer(message.id, new Error(why));
    }
    if (message.frame) confirm(message.frame);
  }

  function caughtUp() {
    had = Math.max(had, until);
  }

  // Confirms the newest frame, at most 20 times a second.
  function confirm(frame) {
    if (confirming) confirming.frame = Math.max(confirming.frame, frame);
    else {
      const mine = (confirming = { frame, socket });
      setTimeout(() => {
        confirming = null;
        if (mine.socket === socket) send({ type: "seen", frame: mine.frame });
      }, CONFIRM_MS);
    }
  }

  function send(message) {
    if (socket?.readyState !== WebSocket.OPEN) return false;
    socket.send(JSON.stringify(message));
    return true;
  }

  function answer(id, problem) {
    const { resolve, reject, timer } = waiting.get(id) ?? {};
    waiting.delete(id);
    clearTimeout(timer);
    if (problem) reject?.(problem);
    else resolve?.();
  }

  function lose(code) {
    socket = null;
    confirming = null;
    clearInterval(watch);
    for (const id of [...waiting.keys()]) answer(id, new Error(_("The connection was lost. Try again.")));
    if (FINAL.has(code)) {
      link("closed", why ?? _("The connection has ended."));
      return;
    }
    link("lost", why);
    retry = setTimeout(open, pause * (0.75 + Math.random() / 2));
    pause = Math.min(2 * pause, LONGEST_PAUSE_MS);
  }

  // Gives up a socket that may be dead; its own goodbye would take too long.
  function drop() {
    const old = socket;
    lose(1006);
    old?.close();
  }

  function link(next, reason) {
    if (next !== state || next === "closed") onLink?.((state = next), reason);
  }

  function wake() {
    if (state === "closed" || document.hidden) return;
    if (socket && performance.now() - heardAt < DOUBT_MS) return;
    if (socket) drop();
    pause = FIRST_PAUSE_MS;
    open();
  }

  function close() {
    const old = socket;
    socket = null;
    state = "closed";
    clearTimeout(retry);
    clearInterval(watch);
    removeEventListener("online", wake);
    document.removeEventListener("visibilitychange", wake);
    old?.close();
  }

  // Asks for a change; done when the server has stored it, rejected with its reason where not.
  const change = (kind, value) => ask({ type: "change", kind, ...(value === undefined ? {} : { value }) });

  // Asks for anything that is answered.
  function ask(message) {
    return new Promise((resolve, reject) => {
      const id = `c${++mark}`;
      const request = { ...message, id };
      if (!send(request)) {
        reject(new Error(_("There is no connection. Try again in a moment.")));
        return;
      }
      const late = () => answer(id, new Error(_("No answer. Try again.")));
      waiting.set(id, { resolve, reject, timer: setTimeout(late, ANSWER_MS) });
    });
  }

  addEventListener("online", wake);
  document.addEventListener("visibilitychange", wake);
  open();
  return { change, ask, say: send, close };
}
