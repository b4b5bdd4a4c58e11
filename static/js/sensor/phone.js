// The page of a phone that is worn: strap, check, then a locked black page that measures strides and sends them.
// In a trial a recording or a simulated leg walks instead.
//
// Samples stay here; only strides leave.

import { _, fill } from "garry/shared/language";
import { WearableDetector } from "garry/sensor/detector";
import { Journal } from "garry/sensor/journal";
import { Motion } from "garry/sensor/motion";
import { LastPlace } from "garry/sensor/place";
import { RecentSamples } from "garry/sensor/recent";
import { Sender } from "garry/sensor/sender";
import { toStep } from "garry/sensor/stride";
import { Symmetry } from "garry/sensor/symmetry";
import { fetchLeg, readRecording, walkInstead } from "garry/sensor/trial";

const HOLD_MS = 2_000;
const TICK_MS = 500;
const STILL_S = 3;
const STILL_RAD_S = 0.15;
const LIFT_RAD_S = 1;
const STRIDES_CHECKED = 3; // five steps of both legs
const SHARE = 0.6; // of all rotation about one axis, below which a phone sits crooked
const LOW_BATTERY = 0.2;
const HARMLESS = ["", "battery", "elsewhere"]; // strides count all the same

const PLACES = { foot: _("foot"), shank: _("shin") };
const SIDES = { left: _("left"), right: _("right") };
const STRAPS = {
  foot: [_("On the shoe’s instep, flat, under the laces"), _("Only a light sensor, never a phone")],
  shank: [
    _("Inner front of the shin, a hand’s width below the knee"),
    _("Screen outward, strap tight"),
    _("Never over a wound"),
  ],
};
// A locked page's count, by the leg that is measured.
const UNITS = { left: _("strides of the left leg"), right: _("strides of the right leg") };
const LINKS = {
  connected: _("connected"),
  "other leg": _("connected, for the steps’ symmetry: the other leg is trained"),
  lost: _("no network: strides are kept and sent later"),
  "no session": _("waiting for a session"),
  ended: _("The session has ended."),
  unauthorized: _("This QR code is no longer valid. Show a new one on the therapist’s page."),
  replaced: _("Another phone has scanned this QR code. Show a new one on the therapist’s page."),
  refused: _("The server does not take these strides."),
};

// The token is kept for a reload of this page, and leaves the address.
const scanned = location.hash.slice(1) || sessionStorage.getItem("sensor") || "";
const { token, place, side } = Object.fromEntries(new URLSearchParams(scanned));
const isTrial = new URLSearchParams(location.search).has("trial");
history.replaceState(null, "", location.pathname + location.search);
window.addEventListener("hashchange", () => location.reload()); // another square was scanned

const body = document.body;
const slots = new Map([...document.querySelectorAll("[data-show]")].map((slot) => [slot.dataset.show, slot]));
const detector = new WearableDetector(place === "foot" ? "foot" : "shank");
const motion = new Motion();
const symmetry = new Symmetry();
const recent = new RecentSamples();
const lastPlace = new LastPlace(place, side);
let elsewhere_deg = 0; // by how much it sits otherwise than last time
let plays = ""; // instead of a leg: "recording" or "simulated"
let chosen = null; // what will play
let walk = null; // what plays, as long as it does
let sender;
let link = "no session";
let count = 0; // strides, for the check
let walked = 0; // those of a session
let battery = 1;
let movedUntil_s = 0;
let heard_s = null; // the newest sample
let still_s = 0;
let hasLifted = false;
let wakeLock;

const show = (name, text) => (slots.get(name).textContent = text);
const now_s = () => (performance.timeOrigin + performance.now()) / 1000;

function step(name) {
  body.dataset.step = name;
  for (const section of document.querySelectorAll("section[data-step]")) section.hidden = section.dataset.step !== name;
}

function refuse(text) {
  show("refusal", text);
  step("refused");
}

function findTrouble() {
  if (!isTrial && document.hidden) return "hidden";
  if (!isTrial && heard_s !== null && now_s() - heard_s > 1) return "gap";
  if (detector.isInDoubt) return "doubt";
  if (movedUntil_s > now_s()) return "moved";
  const minor = battery < LOW_BATTERY ? "battery" : elsewhere_deg ? "elsewhere" : "";
  return motion.trouble(now_s()) || minor;
}

const isWalking = () => ["running", "paused"].includes(sender?.state);

function take(event, isSkipped = false) {
  const sample = motion.read(event);
  if (!sample) return;
  const { time_s, rate, acceleration } = sample;
  recent.add(sample);
  const step_s = heard_s === null ? 0 : time_s - heard_s;
  heard_s = time_s;
  const speed = Math.hypot(...rate);
  if (still_s < STILL_S) still_s = speed < STILL_RAD_S ? still_s + step_s : 0;
  else if (speed > LIFT_RAD_S) hasLifted = true;
  for (const stride of detector.add(time_s, rate, acceleration)) {
    count += 1;
    if (isSkipped) continue;
    walked += Number(isWalking());
    if (stride.reasons.includes("sensor_moved")) movedUntil_s = time_s + 5;
    const trouble = findTrouble();
    // What the therapist sees in amber does not count either.
    if (!HARMLESS.includes(trouble) && !stride.reasons.length) stride.reasons.push(`sensor_${trouble}`);
    sender?.put(toStep(stride, place, side, describeClock(stride)));
  }
}

// How well this phone's clock is known, and with a phone on the other leg how unequal the steps are.
function describeClock(stride) {
  const error_s = sender ? sender.clock.error_s(now_s()) : Infinity;
  if (!Number.isFinite(error_s)) return {};
  return { clock_error_ms: 1000 * error_s, step_asymmetry_percent: symmetry.find(stride, sender.clock, now_s()) };
}

let said = "";
function tick() {
  if (chosen && isWalking()) startPlay();
  const round = walk && plays === "recording" ? walk.progress().time : 1;
  const state = { trouble: findTrouble(), plays, round };
  if (sender && said !== (said = JSON.stringify(state))) sender.say({ ...state, rate_hz: motion.rate_hz });
  if (body.dataset.step === "check") drawCheck();
  show("strides", String(walked));
  const rate = motion.rate_hz === null ? "–" : Math.round(motion.rate_hz);
  const waiting = sender?.waiting ?? 0;
  show("state", fill(_("%(link)s · %(rate)s Hz · %(waiting)s waiting"), { link: LINKS[link], rate, waiting }));
  if (walk) show("playing", describePlayed(walk.progress()));
  else if (chosen) show("playing", _("It walks as soon as the therapist starts the session."));
}

const toMinutes = (s) => `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, "0")}`;

function describePlayed({ time, at_s, length_s, skipped_s }) {
  if (plays === "simulated") return _("Simulated leg");
  const values = { time, at: toMinutes(at_s), of: toMinutes(length_s), skipped: skipped_s };
  if (skipped_s && time === 1) {
    return fill(_("Recording, %(at)s of %(of)s, without its first %(skipped)s s, in which a belt speeds up"), values);
  }
  if (time === 1) return fill(_("Recording, %(at)s of %(of)s"), values);
  return fill(_("Recording again, round %(time)s: %(at)s of %(of)s"), values);
}

function drawCheck() {
  const hasWalked = count >= STRIDES_CHECKED;
  const isDone = { still: still_s >= STILL_S, lift: hasLifted, walk: hasWalked };
  const next = Object.keys(isDone).find((name) => !isDone[name]);
  for (const item of document.querySelectorAll("[data-check]")) {
    item.classList.toggle("done", isDone[item.dataset.check]);
    item.classList.toggle("now", item.dataset.check === next);
  }
  if (!plays && !hasWalked && detector.upright) elsewhere_deg = lastPlace.compare(detector.upright);
  const [sign, text] = judgeCheck(hasWalked, next);
  slots.get("verdict").dataset.sign = sign;
  show("verdict", text);
}

// What the check comes to: [green, amber or "" while it lasts, in words].
function judgeCheck(hasWalked, next) {
  if (detector.isInDoubt) {
    return ["amber", _("Stand still, lift the toes once (shin: swing the leg forward), stand still.")];
  }
  if (hasWalked && detector.axisShare < SHARE) {
    return ["amber", _("It sits crooked or slips round: tighten the strap, and walk again.")];
  }
  if (elsewhere_deg) {
    const text = _(
      "It is turned by %(angle)s° compared with last time. Strap it on as before, or take a new baseline.",
    );
    return ["amber", fill(text, { angle: elsewhere_deg })];
  }
  if (hasWalked && next) return ["amber", _("Not checked yet: stand still for three seconds, then walk on.")];
  return next ? ["", ""] : ["green", _("Good.")];
}

async function keepAwake() {
  if (document.hidden || !navigator.wakeLock) return;
  wakeLock = await navigator.wakeLock.request("screen").catch(() => wakeLock);
}

async function watchBattery() {
  const own = await navigator.getBattery?.();
  if (!own) return;
  const read = () => (battery = own.charging ? 1 : own.level);
  read();
  own.onlevelchange = own.onchargingchange = read;
}

async function begin() {
  // iOS asks the person, and only after a tap.
  if (typeof DeviceMotionEvent.requestPermission === "function") {
    const answer = await DeviceMotionEvent.requestPermission().catch(() => "denied");
    if (answer !== "granted") {
      refuse(_("The phone does not share its movement. Reload this page, and allow it when asked."));
      return;
    }
  }
  await connect();
  window.addEventListener("devicemotion", take);
  step("check");
}

// Nobody stands or lifts a foot in a recording: it is not checked, and walks once the session has started.
function play(what, leg) {
  if (plays) return;
  [plays, chosen] = [what, leg];
  slots.get("playing").hidden = false;
  if (what === "simulated") startPlay();
  tick();
  step(what === "recording" ? "locked" : "check");
}

function startPlay() {
  walk = walkInstead(chosen, take);
  chosen = null;
}

// Nothing walks on in a session that is over.
function endPlay() {
  if (!plays) return;
  walk?.stop();
  [plays, chosen, walk] = ["", null, null];
  show("playing", _("The session has ended. Leave, to choose what plays in the next one."));
  step("locked");
}

async function connect() {
  sender = new Sender(body.dataset.socket, token, side, await Journal.open(), (state, message) => {
    link = state;
    if (state === "ended") endPlay();
    if (["unauthorized", "replaced", "refused"].includes(state)) refuse(message ?? LINKS[state]);
  });
  sender.onContact = (contact) => symmetry.note(contact);
  await sender.open();
  setInterval(tick, TICK_MS);
  document.addEventListener("visibilitychange", () => {
    tick();
    keepAwake();
  });
  keepAwake();
  watchBattery();
}

// What plays in a trial: a file that a person chooses, or the simulated leg.
function offerTrial() {
  document.querySelector("[data-recording]").addEventListener("change", async ({ target }) => {
    const [file] = target.files;
    if (!file) return;
    try {
      play("recording", await readRecording(file));
      show("file", file.name); // which stays on this phone
    } catch (problem) {
      show("problem", problem.message);
    }
  });
  const simulated = document.querySelector("[data-play]");
  simulated.addEventListener("click", async () => play("simulated", await fetchLeg(body.dataset.trial)));
  show("leg", fill(_("%(side)s %(place)s: try a recording"), { side: SIDES[side], place: PLACES[place] }));
  step("trial");
  connect();
}

function holdToLeave(button) {
  let holding;
  const release = () => clearTimeout(holding);
  button.addEventListener("pointerdown", () => (holding = setTimeout(leave, HOLD_MS)));
  for (const name of ["pointerup", "pointerleave", "pointercancel"]) button.addEventListener(name, release);
}

function leave() {
  if (isTrial)
    location.reload(); // where something else is chosen
  else step("check");
}

function lock() {
  if (!plays && detector.upright) lastPlace.keep(detector.upright);
  elsewhere_deg = 0;
  step("locked");
}

if (!isTrial && (!window.isSecureContext || !("DeviceMotionEvent" in window))) {
  refuse(_("Phones measure movement only on pages opened by https."));
  document.querySelector("[data-cure]").hidden = false;
} else if (!token || !(place in PLACES) || !(side in SIDES)) {
  refuse(_("Scan the QR code on the therapist’s page “A phone as a sensor”."));
} else {
  sessionStorage.setItem("sensor", scanned);
  Object.assign(body.dataset, { place, side });
  show("where", fill(_("%(side)s %(place)s"), { side: SIDES[side], place: PLACES[place] }));
  show("strap", STRAPS[place].join("\n"));
  show("unit", UNITS[side]);
  const start = document.querySelector("[data-begin]");
  start.addEventListener("click", begin);
  start.disabled = false; // earlier, a tap would be lost
  if (isTrial) offerTrial();
  else step("strap");
  document.querySelector("[data-lock]").addEventListener("click", lock);
  document.querySelector("[data-save]").addEventListener("click", () => recent.save(`${side} ${place}.csv`));
  holdToLeave(document.querySelector("[data-leave]"));
}
