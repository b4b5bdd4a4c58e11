// What has fallen silent or stopped while somebody walks: an amber banner that says the cure, and a tone when it
// begins. It stays until its cause is gone.

import { _, fill } from "garry/shared/language";
import { soundAlarm } from "garry/monitor/alarm_tone";
import { doubtCure } from "garry/shared/labels";
import { SILENT_S } from "garry/monitor/state";

const FIRST_STRIDE_S = 10; // a walk needs longer to begin
const REFRESH_MS = 250; // silence sends no event
const STORAGE = {
  late: _("The database does not answer: strides wait, and the robot stands still."),
  disk_full: _("The server’s disk is full: strides are not stored. Make room on it."),
};

export function createAlarms({ state }, robot) {
  const place = document.querySelector(".alarms");
  const shown = new Map(); // the banner of each alarm, by its kind
  let [hadTablet, hadRobot] = [false, false];

  function describeSource({ presence }) {
    if (!presence.source) {
      return _("The sensor is not connected. Look at its switch and its cable, or pause.");
    }
    const running = state.sinceRunning_s;
    const isFirst = presence.stride_ago_s == null;
    const silent = isFirst ? running : Math.min(running, presence.stride_ago_s + state.sincePresence_s);
    if (silent < (isFirst ? FIRST_STRIDE_S : SILENT_S.stride)) return "";
    const text = isFirst
      ? _("No stride for %(count)s s. Does the patient walk? Look at the sensor, or pause.")
      : _("The sensor is silent for %(count)s s. Does the patient walk? Look at the sensor, or pause.");
    return fill(text, { count: Math.floor(silent) });
  }

  function describeTablet({ presence: { tablets, tablet_ago_s: ago } }) {
    hadTablet ||= tablets > 0;
    if (!hadTablet) return "";
    const isSilent = ago != null && ago + state.sincePresence_s > SILENT_S.tablet;
    if (tablets && !isSilent) return "";
    return _("The tablet is lost: the patient sees no feedback. Look at its screen and its Wi-Fi, or pause.");
  }

  function describeRobot({ presence }) {
    hadRobot ||= presence.robot;
    if (hadRobot && !presence.robot) {
      return _("The robot is lost: it stands still. Look at its switch and its network.");
    }
    return robot.alarm;
  }

  function findAll(session) {
    const storage = ["storage", STORAGE[session.presence.storage] ?? ""];
    if (!["running", "paused"].includes(session.state)) {
      [hadTablet, hadRobot] = [session.presence.tablets > 0, session.presence.robot];
      return new Map([storage]);
    }
    return new Map([
      storage,
      ["source", session.state === "running" ? describeSource(session) : ""],
      ["signals", doubtCure(state.lastStride?.reasons ?? [])],
      ["tablet", describeTablet(session)],
      ["robot", describeRobot(session)],
    ]);
  }

  function show(kind, text) {
    if (!shown.has(kind)) {
      const banner = document.createElement("p");
      banner.className = "notice alarm row wrap";
      banner.dataset.alarm = kind;
      shown.set(kind, place.appendChild(banner));
      if (kind !== "robot" || !robot.wasStoppedHere) soundAlarm();
    }
    const banner = shown.get(kind);
    if (banner.textContent !== text) banner.textContent = text;
  }

  function draw(session) {
    const alarms = findAll(session);
    for (const [kind, banner] of [...shown]) {
      if (alarms.get(kind)) continue;
      banner.remove();
      shown.delete(kind);
    }
    for (const [kind, text] of alarms) if (text) show(kind, text);
  }

  setInterval(() => state.session && draw(state.session), REFRESH_MS);
  return { draw };
}
