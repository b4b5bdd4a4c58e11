// The session's phases on top of the page, each as wide as it is long and filled as far as it is walked.

import { _, fill } from "garry/shared/language";
import { clock } from "garry/shared/format";
import { phaseName } from "garry/shared/labels";
import { hasFallen } from "garry/monitor/alarm_causes";

const STRIDE_S = 1.1; // of phases that end by strides, and only for their width
const OPEN_S = 60; // the least width of a phase that a therapist ends

const lengthOf = ({ seconds, strides }) => seconds || (strides ? STRIDE_S * strides : null);

// Return how long each phase is drawn; those without an end share what is left of the planned time.
function lengths({ phases, target }) {
  const known = phases.map(lengthOf);
  const open = known.filter((length) => length === null).length;
  const rest = (target.duration_s ?? 0) - known.reduce((sum, length) => sum + (length ?? 0), 0);
  return known.map((length) => length ?? Math.max(OPEN_S, rest / open));
}

// Return how far the phase at hand has come, 0 to 1, and what is left of it in words.
function progress({ phase: { seconds, strides }, phase_s, phase_strides }, length) {
  if (seconds) return [phase_s / seconds, fill(_("%(left)s left"), { left: clock(Math.max(0, seconds - phase_s)) })];
  const count = Math.max(0, strides - phase_strides);
  if (strides) return [phase_strides / strides, fill(_("strides to go: %(count)s"), { count })];
  return [phase_s / length, ""];
}

// Return what draws a session's phases into the list.
export function createPhaseBar(list) {
  // Hide the names that have no room in their part of the bar.
  function fitNames() {
    for (const item of list.children) item.classList.remove("narrow");
    const narrow = [...list.children].filter((item) => item.scrollWidth > item.clientWidth);
    for (const item of narrow) item.classList.add("narrow");
  }

  function draw(session) {
    const { phases, phase } = session;
    const long = lengths(session);
    const [done, left] = progress(session, long[phase.index]);
    if (list.children.length !== phases.length) {
      const items = phases.map(({ name }) =>
        Object.assign(document.createElement("li"), { textContent: phaseName(name) }),
      );
      list.replaceChildren(...items);
    }
    [...list.children].forEach((item, index) => {
      const isNow = index === phase.index;
      const text = isNow && left ? `${phaseName(phase.name)} · ${left}` : "";
      const isHeld = isNow && session.state === "paused" && (session.fall_seen || hasFallen(session));
      const label = isHeld ? _("Paused") : text || phaseName(phases[index].name);
      if (item.textContent !== label) item.textContent = label;
      item.style.setProperty("--share", long[index]);
      item.style.setProperty("--done", isNow ? Math.min(1, done) : index < phase.index ? 1 : 0);
      item.classList.toggle("was", index < phase.index);
      item.classList.toggle("is", isNow);
      if (index === phase.index) item.setAttribute("aria-current", "step");
      else item.removeAttribute("aria-current");
    });
    if (list.dataset.of === list.textContent) return;
    list.dataset.of = list.textContent;
    fitNames();
  }

  new ResizeObserver(fitNames).observe(list);
  return draw;
}
