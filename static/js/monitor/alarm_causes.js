// What a therapist has to look at: a table of causes, the one behind the others first. Each has the consequences that
// it hides, a sentence with the cure, and what its button does.
//
//   describe(session, page)   the sentence; "" where it is not so. A fall has lines: who, where, what is so
//   asks                      the template of a question that its banner asks
//   action, undo              functions (session, page) that return what is offered: [label, act, how long]
//   isRed                     somebody fell; everything else is amber
//   isCalm                    no alarm: it is told, and makes no sound

import { _, fill } from "garry/shared/language";
import { clock, minutesAgo } from "garry/shared/format";
import { doubtCure, reasonName, wornCure } from "garry/shared/labels";
import { SILENT_S, hasStarted } from "garry/monitor/state";
import { describeReason } from "garry/monitor/robot_text";

const FIRST_STRIDE_S = 10; // a walk needs longer to begin
const RESTART_S = 15; // after which what has not come back is told
export const TAKEN_BACK_WITHIN_S = 10; // a fall that was tapped by mistake
const LAST = 10; // strides, of which half may not count before that is told
const STORAGE = {
  late: _("The database is not answering: strides are waiting, and the robot is standing still."),
  disk_full: _("The server’s disk is full: strides are not stored. Make room on it."),
};
const PAUSES = {
  patient: _("Paused on the patient’s page."),
  rest: _("The plan has a rest of %(time)s here."),
  therapist: _("Paused by the therapist."),
  heart_rate: _("The heart rate is above its limit: let the patient rest."),
};

const timeOf = (alarm) =>
  new Date(alarm.at).toLocaleTimeString(document.documentElement.lang, { timeStyle: "short", hourCycle: "h23" });
const alarmOf = ({ alarms }, kind) => alarms.find((one) => one.kind === kind);

function describeServer({ number }, { socket }) {
  const silent_s = socket.silentFor() / 1000;
  if (!socket.isStale()) return "";
  const text = number
    ? _("The server has not answered for %(count)s s: this page is that old. Stored: all up to step %(number)s.")
    : _("The server has not answered for %(count)s s: this page is that old.");
  const values = { count: Math.floor(silent_s), number };
  return `${fill(text, values)} ${_("To stop the robot, use its own switch.")}`;
}

// Whether somebody fell, and nobody has said yet that they saw it: until then nothing goes on.
export const hasFallen = (session) => Boolean(session?.alarms && alarmOf(session, "fall"));

function describeFall(session, { robot, state }) {
  const alarm = alarmOf(session, "fall");
  if (!alarm) return "";
  const fell = fill(_("%(name)s fell, %(time)s."), { name: session.about.nickname, time: timeOf(alarm) });
  const { station: place } = document.getElementById("monitor").dataset;
  const isHere = state.fellHereAt !== null;
  const where = place && fill(isHere ? _("Where: %(place)s") : _("Go to %(place)s."), { place });
  const noted = fill(_("Noted by %(who)s"), { who: alarm.by || "–" });
  const facts = [
    `${noted}, ${minutesAgo(alarm.at)}`,
    session.state === "paused" && _("Session paused"),
    robot.isHere && robot.isStopped && _("Robot stopped"),
  ];
  return [fell, where || "", _("Nobody has answered yet"), ...facts.filter(Boolean)].join("\n");
}

// Whoever tapped by mistake takes the note back, and only that: going on, and letting the robot move, are taps of
// their own.
function offerUndo(_session, { state }) {
  const left_s = TAKEN_BACK_WITHIN_S - state.sinceFell_s;
  if (left_s <= 0) return null;
  const left = fill(_("%(time)s left"), { time: `${Math.ceil(left_s)} s` });
  return [_("It was not a fall"), ({ remark }) => remark("fall_withdrawn"), left];
}

const isSeen = (session) => Boolean(session?.fall_seen && session.state !== "running");

// Why nothing goes on yet: nobody has seen to a fall, or said how the patient is; "" where it may.
export function whyHeld(session) {
  if (hasFallen(session)) return _("once the fall is seen to");
  if (!isSeen(session) || session.fall_seen.severity !== null) return "";
  return fill(_("first: is %(name)s hurt?"), { name: session.about.nickname });
}

// Who takes care of it, until the walk goes on.
function describeSeen(session) {
  if (!isSeen(session)) return "";
  const { fall_seen: seen, about } = session;
  const values = { who: seen.by, name: about.nickname, time: timeOf(seen) };
  return fill(_("%(who)s takes care of %(name)s’s fall, %(time)s."), values);
}

function describeOwnStop(session, { robot }) {
  const alarm = alarmOf(session, "robot_stop");
  if (!alarm) return "";
  const values = { why: describeReason(alarm.reason), time: timeOf(alarm) };
  const text = robot.isSimulated
    ? _("The simulated robot stopped by itself, %(time)s: %(why)s.")
    : _("The robot stopped by itself, %(time)s: %(why)s.");
  return `${fill(text, values)} ${robot.alarm && robot.cure}`.trim(); // before it is let move, from the banner too
}

function describeRestart({ state, pause_reason: reason }) {
  if (state !== "paused" || reason !== "restart") return "";
  return _("The server was restarted; nothing was lost. Resume when ready.");
}

function describeEnd({ presence, state }) {
  if (state !== "running" || presence.source_trouble !== "ended") return "";
  return _("The recording has ended: no stride follows. End the session.");
}

function describeSource({ presence, state: sessionState }, { state }) {
  if (sessionState !== "running") return "";
  if (!presence.source) {
    return _("The sensor is not connected. Check its switch and its cable, or pause.");
  }
  const running = state.sinceRunning_s;
  const isFirst = presence.stride_ago_s == null;
  const silent = isFirst ? running : Math.min(running, state.strideAgo_s);
  if (silent < (isFirst ? FIRST_STRIDE_S : SILENT_S.stride)) return "";
  const text = isFirst
    ? _("No stride for %(count)s s. Is the patient walking? Check the sensor, or pause.")
    : _("The sensor has been silent for %(count)s s. Is the patient walking? Check the sensor, or pause.");
  return fill(text, { count: Math.floor(silent) });
}

function describeDoubt(session, { state }) {
  return hasStarted(session) ? doubtCure(state.lastStride?.reasons ?? []) : "";
}

// What half of the last strides do not count for, and its cure.
function describeInvalid(session, { state }) {
  if (!hasStarted(session)) return "";
  const lost = state.strides.slice(-LAST).flatMap(({ reasons }) => (reasons ?? []).filter(wornCure));
  const reason = lost.find((one) => 2 * lost.filter((other) => other === one).length >= LAST);
  if (!reason) return "";
  const values = { why: reasonName(reason), cure: wornCure(reason) };
  return fill(_("Half of the strides do not count: %(why)s. %(cure)s"), values);
}

function describeTablet(session, { state }) {
  if (!hasStarted(session) || !state.hadTablet || state.isTabletHeard) return "";
  return _("The tablet has dropped out: the patient sees no feedback. Check its screen and its Wi-Fi, or pause.");
}

function describeRobot(session, { state, robot }) {
  if (!hasStarted(session)) return "";
  if (state.hadRobot && !session.presence.robot) {
    return _("The robot has dropped out and is standing still. Check its switch and its network.");
  }
  return isSeen(session) ? "" : robot.alarm; // its panel lets it move
}

function describePause({ state, pause_reason: reason, rest_s: rest, fall_seen: seen }) {
  if (state !== "paused" || (seen && reason === "therapist")) return ""; // who takes care of the fall is told
  const why = fill(PAUSES[reason] ?? _("Paused."), { time: clock(rest ?? 0) });
  return reason === "therapist" ? why : `${why} ${_("Resume when ready.")}`;
}

const letMove = [_("Let it move"), ({ robot }) => robot.order("arm")];

export const CAUSES = [
  {
    cause: "server",
    hides: ["fall", "robot_stop", "storage", "restart", "source", "tablet", "robot", "why"],
    describe: describeServer,
  },
  {
    cause: "fall",
    hides: ["seen", "robot_stop", "restart", "ended", "source", "signals", "strides", "tablet", "robot", "why"],
    isRed: true,
    describe: describeFall,
    isOwn: ({ state }) => state.fellHereAt !== null,
    action(_session, { state }) {
      const label = state.fellHereAt === null ? _("I’m going there") : _("I’ll take care of it");
      return [label, ({ remark }) => remark("fall_acknowledged")];
    },
    undo: offerUndo,
  },
  {
    cause: "seen",
    hides: [],
    describe: describeSeen,
    isCalm: true,
    asks: "fall-severity",
  },
  {
    cause: "robot_stop",
    hides: ["robot"],
    describe: describeOwnStop,
    action: (session, page) => page.robot.alarm && !whyHeld(session) && letMove,
    undo: () => [_("I have seen it"), ({ remark }) => remark("stop_acknowledged")],
  },
  {
    cause: "storage",
    hides: ["source", "robot", "why"],
    describe: ({ presence }) => STORAGE[presence.storage] ?? "",
  },
  {
    cause: "restart",
    hides: ["why"],
    // Devices come back within seconds; until then their absence follows from the restart.
    hidesAtFirst: { within_s: RESTART_S, causes: ["source", "tablet", "robot"] },
    describe: describeRestart,
    isCalm: true,
  },
  { cause: "ended", hides: ["source", "strides"], describe: describeEnd, isCalm: true },
  { cause: "source", hides: ["strides"], describe: describeSource },
  { cause: "signals", hides: ["strides"], describe: describeDoubt },
  { cause: "strides", hides: [], describe: describeInvalid },
  { cause: "tablet", hides: [], describe: describeTablet },
  {
    cause: "robot",
    hides: [],
    describe: describeRobot,
    isOwn: ({ robot }) => robot.wasStoppedHere,
    action: ({ presence }) => presence.robot && letMove,
  },
  { cause: "why", hides: [], describe: describePause, isCalm: true },
];

// Return the causes that are to be told now, as [row, sentence], the one behind the others first.
export function findCauses(session, page) {
  const found = CAUSES.map((row) => [row, row.describe(session, page)]).filter(([, sentence]) => sentence);
  const hidden = new Set(found.flatMap(([row]) => row.hides));
  for (const [{ hidesAtFirst: first }] of found) {
    if (first && page.state.sinceSnapshot_s < first.within_s) for (const cause of first.causes) hidden.add(cause);
  }
  return found.filter(([{ cause }]) => !hidden.has(cause));
}
