// The socket of a session's page: stays connected, passes everything on once and in order.
//
//   const socket = connect("/ws/session/7/patient/", { onSnapshot, onSteps, onEvent, onLink });
//
// onSnapshot(snapshot): all that the page shows, as of now; after each connection. It replaces what
//   the page knew: totals come from here and from events, never from counting.
// onSteps(steps): past steps that this page does not have, oldest first, after a break.
// onEvent(event): what has just happened; what took too long to get here is not `live`.
// onLink(state, reason): "open", "lost" (it comes back by itself) or "closed" (it does not; `reason`
//   is a text for people).
//
// A replay has the same interface (replay/session_socket.js). So that silence can be played, too, waiting is the
// socket's: `after(ms, act)` returns what cancels it.

import { _ } from "garry/shared/language";

const wire = JSON.parse(document.getElementById("wire").textContent); // robot/wire/
const STALE_MS = 2 * wire.heartbeat_ms; // after which nothing on the page counts as present
const LATE_S = 2; // what was sent so long ago is told, and not shown as live
const SILENCE_MS = 8 * wire.heartbeat_ms;
const DOUBT_MS = 4 * wire.heartbeat_ms; // after which an old socket is not trusted when the tablet wakes up
const SEEN_MS = 4 * wire.heartbeat_ms; // a page confirms that it is there at least so often
const CONFIRM_MS = 1_000;
const CONFIRM_FRAMES = 8; // after so many at once: the server waits for its page
const ANSWER_MS = 8_000;
const FIRST_PAUSE_MS = 200;
const LONGEST_PAUSE_MS = 5_000;
const FINAL = new Set(wire.final_codes); // do not retry as it is
const STEPS = new Set(["step", "missing", "calm"]);
// What ends a page's connection or refuses an order, by its code; others come with a text of their own.
const REFUSALS = {
  sign_in: _("Sign in again, or pair the tablet again."),
  no_session: _("There is no such session for you."),
  not_open: _("The session is not open. Reload the page."),
  not_stored: _("It could not be stored. Try again."),
};
const refusal = ({ code, message }) => REFUSALS[code] ?? message;

export function connect(path, { onSnapshot, onSteps, onEvent, onLink } = {}) {
  const pending = new Map(); // changes that have not been answered
  let socket, retryTimer, watchdog, confirmation, closeReason;
  let state = "";
  let retryPause = FIRST_PAUSE_MS;
  let receivedAt = 0;
  let heardAt = performance.now(); // unlike `receivedAt` not when a new connection is tried
  let confirmedAt = 0;
  let clockAhead_s, sentAt_s; // ours before the server's, by this connection's quickest frame; its time at the last one
  let lastNumber = null; // the last step that this page has
  let catchUpTo = null; // steps up to this one are being sent after a break
  let confirmedFrame = 0;
  let requests = 0;

  function open() {
    clearTimeout(retryTimer);
    const url = new URL(path, location.href);
    url.protocol = url.protocol.replace("http", "ws");
    if (lastNumber !== null) url.searchParams.set("after", lastNumber);
    closeReason = null;
    receivedAt = performance.now();
    const own = (socket = new WebSocket(url));
    own.onmessage = ({ data }) => own === socket && receive(JSON.parse(data));
    own.onclose = ({ code }) => own === socket && handleClose(code);
    clearInterval(watchdog);
    watchdog = setInterval(() => performance.now() - receivedAt > SILENCE_MS && drop(), 1_000);
  }

  function receive(message) {
    receivedAt = performance.now();
    if (message.type !== "error") heardAt = receivedAt; // a server that sends us away knows nothing of the session
    switch (message.type) {
      case "snapshot":
        clockAhead_s = Infinity; // perhaps it is another server
        measureAge(message.now);
        retryPause = FIRST_PAUSE_MS;
        catchUpTo = message.number;
        if (lastNumber === null || lastNumber > catchUpTo) lastNumber = catchUpTo;
        setLink("open");
        onSnapshot?.(message);
        break;
      case "steps": {
        const missed = message.steps.filter(({ number }) => number > lastNumber);
        if (missed.length) {
          lastNumber = missed.at(-1).number;
          onSteps?.(missed);
        }
        break;
      }
      case "events":
        caughtUp();
        for (const event of message.events) {
          if (STEPS.has(event.kind)) {
            if (event.number <= lastNumber) continue;
            lastNumber = event.number;
          }
          if (event.at && measureAge(event.at) > LATE_S) event.live = false;
          onEvent?.(event);
        }
        break;
      case "heartbeat":
        caughtUp();
        if (heardAt - confirmedAt > SEEN_MS) confirm(0); // there is a page behind this socket
        if (message.presence) onEvent?.({ kind: "presence", presence: message.presence });
        break;
      case "done":
        settle(message.id);
        break;
      case "error":
        if (message.server) goTo(message.server);
        closeReason = refusal(message);
        if (message.id) settle(message.id, new Error(closeReason));
    }
    if (message.frame) confirm(message.frame, message.type === "steps");
  }

  // Another server has the clinic: the proxy chooses it by the cookie, from now on also for pages.
  function goTo(server) {
    const cookie = `${wire.server_cookie}=${server}`;
    if (document.cookie.split("; ").includes(cookie)) return; // it was asked already: not at once again
    const secure = location.protocol === "https:" ? "; secure" : "";
    document.cookie = `${cookie}; path=/; samesite=strict${secure}`;
    retryPause = FIRST_PAUSE_MS;
  }

  // Return how old something of this time of the server is [s]; its clock and ours may differ. Where times go back,
  // its clock was set.
  function measureAge(at_s) {
    const ahead = performance.now() / 1000 - at_s;
    if (at_s < sentAt_s - LATE_S) clockAhead_s = Infinity;
    sentAt_s = at_s;
    clockAhead_s = Math.min(clockAhead_s, ahead);
    return ahead - clockAhead_s;
  }

  function caughtUp() {
    lastNumber = Math.max(lastNumber, catchUpTo);
  }

  // Confirm the newest frame: within a second, and at once where many have come or past steps wait.
  function confirm(frame, now = false) {
    confirmation ??= { frame: 0, timer: setTimeout(sendConfirmation, CONFIRM_MS) };
    confirmation.frame = Math.max(confirmation.frame, frame);
    if (now || frame - confirmedFrame >= CONFIRM_FRAMES) sendConfirmation();
  }

  function sendConfirmation() {
    const { frame } = forgetConfirmation();
    if (!send({ type: "seen", frame })) return;
    confirmedFrame = Math.max(confirmedFrame, frame);
    confirmedAt = performance.now();
  }

  function forgetConfirmation() {
    const forgotten = confirmation;
    clearTimeout(forgotten?.timer);
    confirmation = null;
    return forgotten;
  }

  function send(message) {
    if (socket?.readyState !== WebSocket.OPEN) return false;
    socket.send(JSON.stringify(message));
    return true;
  }

  function settle(id, problem) {
    const { resolve, reject, timer } = pending.get(id) ?? {};
    pending.delete(id);
    clearTimeout(timer);
    if (problem) reject?.(problem);
    else resolve?.();
  }

  function handleClose(code) {
    socket = null;
    forgetConfirmation();
    confirmedFrame = 0;
    clearInterval(watchdog);
    for (const id of [...pending.keys()]) settle(id, new Error(_("The connection was lost. Try again.")));
    if (FINAL.has(code)) {
      setLink("closed", closeReason ?? _("The connection has ended."));
      return;
    }
    setLink("lost", closeReason);
    retryTimer = setTimeout(open, retryPause * (0.75 + Math.random() / 2));
    retryPause = Math.min(2 * retryPause, LONGEST_PAUSE_MS);
  }

  // Give up a socket that may be dead; closing it properly would take too long.
  function drop() {
    const old = socket;
    handleClose(1006);
    old?.close();
  }

  function setLink(next, reason) {
    if (next !== state || next === "closed") {
      state = next;
      onLink?.(state, reason);
    }
  }

  function reconnectIfStale() {
    if (state === "closed" || document.hidden) return;
    if (socket && performance.now() - receivedAt < DOUBT_MS) return;
    if (socket) drop();
    retryPause = FIRST_PAUSE_MS;
    open();
  }

  function close() {
    const old = socket;
    socket = null;
    state = "closed";
    forgetConfirmation();
    clearTimeout(retryTimer);
    clearInterval(watchdog);
    removeEventListener("online", reconnectIfStale);
    document.removeEventListener("visibilitychange", reconnectIfStale);
    old?.close();
  }

  // Ask for a change; resolves when the server has stored it, rejects with the reason otherwise.
  const change = (kind, value) => ask({ type: "change", kind, ...(value === undefined ? {} : { value }) });

  // Send a message that the server answers.
  function ask(message) {
    return new Promise((resolve, reject) => {
      const id = `c${++requests}`;
      const request = { ...message, id };
      if (!send(request)) {
        reject(new Error(_("There is no connection. Try again in a moment.")));
        return;
      }
      const late = () => settle(id, new Error(_("No answer. Try again.")));
      pending.set(id, { resolve, reject, timer: setTimeout(late, ANSWER_MS) });
    });
  }

  function after(ms, act) {
    const timer = setTimeout(act, ms);
    return () => clearTimeout(timer);
  }

  // How long the server has said nothing [ms], and whether that is too long for anything here to count as present.
  const silentFor = () => performance.now() - heardAt;
  const isStale = () => state !== "closed" && silentFor() > STALE_MS;

  addEventListener("online", reconnectIfStale);
  document.addEventListener("visibilitychange", reconnectIfStale);
  open();
  return { change, ask, send, close, after, silentFor, isStale };
}
