// The page of a phone that is worn: strap, check, then a locked black page that measures strides and sends them.
//
// Samples stay here; only strides leave.

import { _, fill } from "garry/shared/language";
import { WearableDetector } from "garry/sensor/detector";
import { Journal } from "garry/sensor/journal";
import { Motion } from "garry/sensor/motion";
import { Sender } from "garry/sensor/sender";
import { toStep } from "garry/sensor/stride";

const HOLD_MS = 2_000;
const TICK_MS = 500;
const STILL_S = 3;
const STILL_RAD_S = 0.15;
const LIFT_RAD_S = 1;
const STRIDES_CHECKED = 3; // five steps of both legs
const SHARE = 0.6; // of all rotation about one axis, below which a phone sits crooked
const LOW_BATTERY = 0.2;

const PLACES = { foot: _("foot"), shank: _("shin") };
const SIDES = { left: _("left"), right: _("right") };
const STRAPS = {
  foot: _("On the shoe’s instep, under the laces, flat. Only a light sensor, never a phone."),
  shank: _("On the inner front of the shin, a hand below the knee, screen outward. Tight, never over a wound."),
};
const LINKS = {
  connected: _("connected"),
  lost: _("no network: strides are kept and sent later"),
  "no session": _("waiting for a session"),
  unauthorized: _("This square is no longer valid. Show a new one on the therapist’s page."),
  replaced: _("Another phone has scanned this square. Show a new one on the therapist’s page."),
  refused: _("The server does not take these strides."),
};

// The token is kept for a reload of this page, and leaves the address.
const scanned = location.hash.slice(1) || sessionStorage.getItem("sensor") || "";
const { token, place, side } = Object.fromEntries(new URLSearchParams(scanned));
history.replaceState(null, "", location.pathname);
window.addEventListener("hashchange", () => location.reload()); // another square was scanned

const body = document.body;
const slots = new Map([...document.querySelectorAll("[data-show]")].map((slot) => [slot.dataset.show, slot]));
const detector = new WearableDetector(place === "foot" ? "foot" : "shank");
const motion = new Motion();
let sender;
let link = "no session";
let count = 0;
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
  if (document.hidden) return "hidden";
  if (heard_s !== null && now_s() - heard_s > 1) return "gap";
  if (detector.isInDoubt) return "doubt";
  if (movedUntil_s > now_s()) return "moved";
  return motion.trouble(now_s()) || (battery < LOW_BATTERY ? "battery" : "");
}

function take(event) {
  const sample = motion.read(event);
  if (!sample) return;
  const { time_s, rate, acceleration } = sample;
  const step_s = heard_s === null ? 0 : time_s - heard_s;
  heard_s = time_s;
  const speed = Math.hypot(...rate);
  if (still_s < STILL_S) still_s = speed < STILL_RAD_S ? still_s + step_s : 0;
  else if (speed > LIFT_RAD_S) hasLifted = true;
  for (const stride of detector.add(time_s, rate, acceleration)) {
    count += 1;
    if (stride.reasons.includes("sensor_moved")) movedUntil_s = time_s + 5;
    const trouble = findTrouble();
    // What the therapist sees in amber does not count either.
    if (trouble && trouble !== "battery" && !stride.reasons.length) stride.reasons.push(`sensor_${trouble}`);
    sender?.put(toStep(stride, place, side));
  }
}

let said = null;
function tick() {
  const trouble = findTrouble();
  if (trouble !== said) sender?.say((said = trouble));
  if (body.dataset.step === "check") drawCheck();
  show("strides", String(count));
  const rate = motion.rate_hz === null ? "–" : Math.round(motion.rate_hz);
  const waiting = sender?.waiting ?? 0;
  show("state", fill(_("%(link)s · %(rate)s Hz · %(waiting)s waiting"), { link: LINKS[link], rate, waiting }));
}

function drawCheck() {
  const hasWalked = count >= STRIDES_CHECKED;
  const isDone = { still: still_s >= STILL_S, lift: hasLifted, walk: hasWalked };
  const next = Object.keys(isDone).find((name) => !isDone[name]);
  for (const item of document.querySelectorAll("[data-check]")) {
    item.classList.toggle("done", isDone[item.dataset.check]);
    item.classList.toggle("now", item.dataset.check === next);
  }
  const isCrooked = hasWalked && detector.axisShare < SHARE;
  const verdict = slots.get("verdict");
  verdict.dataset.sign = isCrooked || detector.isInDoubt ? "amber" : hasWalked ? "green" : "";
  if (detector.isInDoubt)
    show("verdict", _("Stand still, lift the toes (shin: swing the leg forward) once, stand still."));
  else if (isCrooked) show("verdict", _("It sits crooked or turns: tighten the strap, and walk again."));
  else show("verdict", hasWalked ? _("Good.") : "");
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
      refuse(_("Movement is not allowed. Reload this page, and allow it when the phone asks."));
      return;
    }
  }
  sender = new Sender(body.dataset.socket, token, await Journal.open(), (state, message) => {
    link = state;
    if (["unauthorized", "replaced", "refused"].includes(state)) refuse(message ?? LINKS[state]);
  });
  await sender.open();
  window.addEventListener("devicemotion", take);
  setInterval(tick, TICK_MS);
  document.addEventListener("visibilitychange", () => {
    tick();
    keepAwake();
  });
  await keepAwake();
  watchBattery();
  step("check");
}

function holdToLeave(button) {
  let holding;
  const release = () => clearTimeout(holding);
  button.addEventListener("pointerdown", () => (holding = setTimeout(() => step("check"), HOLD_MS)));
  for (const name of ["pointerup", "pointerleave", "pointercancel"]) button.addEventListener(name, release);
}

if (!window.isSecureContext || !("DeviceMotionEvent" in window)) {
  refuse(
    _("Phones measure movement only on pages that came by https. Open GARRY by its https address, and pair again."),
  );
} else if (!token || !(place in PLACES) || !(side in SIDES)) {
  refuse(_("Scan the square on the therapist’s page: “A phone as a sensor”."));
} else {
  sessionStorage.setItem("sensor", scanned);
  body.dataset.place = place;
  show("where", fill(_("%(side)s %(place)s"), { side: SIDES[side], place: PLACES[place] }));
  show("strap", STRAPS[place]);
  step("strap");
  document.querySelector("[data-begin]").addEventListener("click", begin);
  document.querySelector("[data-lock]").addEventListener("click", () => step("locked"));
  holdToLeave(document.querySelector("[data-leave]"));
}
