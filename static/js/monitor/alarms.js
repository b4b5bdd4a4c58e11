// Shows what a therapist has to look at (alarm_causes.js): the cause behind the others first, with its button, and
// a tone when it begins. It stays until it is gone; a fall, which is red on each page, and the robot's own stop until
// somebody has acknowledged it.

import { soundAlarm } from "garry/monitor/alarm_tone";
import { findCauses } from "garry/monitor/alarm_causes";
import { update } from "garry/monitor/state";

const REFRESH_MS = 250; // silence sends no event

const element = (tag, textContent) => Object.assign(document.createElement(tag), { textContent });

export function createAlarms(page) {
  const { state } = page;
  const place = document.querySelector(".alarms");
  const steps = document.getElementById("fall-steps");
  const shown = new Map(); // the banner of each cause

  function make({ cause, isRed, isCalm, isOwn, asks }) {
    const banner = document.createElement("div");
    banner.className = "notice alarm row wrap";
    banner.classList.toggle("red", Boolean(isRed));
    banner.dataset.alarm = cause;
    banner.append(Object.assign(element("div"), { className: "grow" }));
    if (asks) banner.append(document.getElementById(asks).content.cloneNode(true));
    if (!isCalm && !isOwn?.(page)) soundAlarm();
    return banner;
  }

  // One sentence; or of a fall who, where, what to do, that nobody did, and what else is so, as in sessions/alarm.html.
  function drawWords(banner, sentence) {
    if (banner.dataset.of === sentence) return;
    banner.dataset.of = sentence;
    const [who, where, open, ...facts] = sentence.split("\n");
    const badge = (text) => Object.assign(element("span", `${text} `), { className: "badge" });
    if (where === undefined) return banner.firstChild.replaceChildren(who);
    const heading = [`${who} `, where].filter(Boolean).map((text) => element("b", text));
    banner.firstChild.replaceChildren(...heading, steps.content.cloneNode(true), badge(open));
    const told = Object.assign(element("small"), { className: "row wrap" });
    told.append(...facts.map(badge));
    banner.querySelector("small")?.remove();
    banner.firstChild.after(told); // the button stays where it is
  }

  function drawButton(banner, look, action) {
    let button = [...banner.children].find(({ className }) => className === look);
    if (!action) return button?.remove();
    if (!button) {
      button = banner.appendChild(document.createElement("button"));
      button.className = look;
    }
    const [label, act, left] = action;
    if (button.textContent !== label) button.textContent = label;
    if (left) button.dataset.left = left; // drawn by CSS: screen readers are not told each second
    button.onclick = () => act(page);
  }

  function draw(session) {
    const found = findCauses(session, page);
    const causes = new Set(found.map(([{ cause }]) => cause));
    for (const [cause, banner] of [...shown]) {
      if (causes.has(cause)) continue;
      banner.remove();
      shown.delete(cause);
    }
    found.forEach(([row, sentence], index) => {
      if (!shown.has(row.cause)) shown.set(row.cause, make(row));
      const banner = shown.get(row.cause);
      if (place.children[index] !== banner) place.insertBefore(banner, place.children[index] ?? null);
      drawWords(banner, sentence);
      drawButton(banner, row.isRed ? "btn big seen" : "btn small", row.action?.(session, page));
      drawButton(banner, "btn quiet", row.undo?.(session, page));
    });
    document.body.classList.toggle("stale", causes.has("server"));
  }

  setInterval(() => state.session && draw(state.session), REFRESH_MS);
  return {
    draw,
    events: {
      state(session) {
        if (session.state === "running") session.fall_seen = null;
      },
      alarms(session, event) {
        update(session, event, ["alarms", "stop_reason", "fall_seen"]);
      },
    },
  };
}
