// A step in words, emblem and number, and everything else the page says. Draws only what has changed.

import { _, fill, n_, number as decimal } from "garry/shared/language";
import { isStill } from "garry/walk/reduced_motion";
import { count, partLeft, signed, spoken, timeLeft, wordsFor } from "garry/walk/text";

const ROLL = { duration: 300, easing: "cubic-bezier(.2, .8, .2, 1)" };
const SWAP = { duration: 200, easing: "cubic-bezier(.2, .8, .2, 1)" };
const SMALLER = 4; // sizes that a long phrase may shrink through

const rosette = Array.from({ length: 240 }, (_, i) => {
  const angle = (Math.PI * i) / 120;
  const radius = 137 + 10 * Math.cos(12 * angle);
  return `${(150 + radius * Math.cos(angle)).toFixed(1)} ${(150 + radius * Math.sin(angle)).toFixed(1)}`;
}).join("L");

export function createFeedback(body) {
  const find = (selector) => body.querySelector(selector);
  const [phrase, words, sub, said] = [".phrase", ".words", ".sub", ".said"].map(find);
  const [label, key, run, runWords] = [".label", ".key", ".run", ".run span"].map(find);
  const [time, part, bar, partWords] = [".time", ".part", ".part progress", ".part p"].map(find);
  const emblem = find(".emblem svg");
  const signs = emblem.querySelectorAll("text");
  const beads = run.querySelectorAll("i");
  const name = find("header b").textContent.trim();
  const sizes = new Map(); // of phrases that were measured before
  let drawn = -1;
  let shown = 0; // the score
  find(".gain path").setAttribute("d", `M${rosette}Z`);
  addEventListener("resize", () => sizes.clear());

  function set(element, text) {
    if (element.textContent === text) return false;
    element.textContent = text;
    return true;
  }

  function say(text) {
    if (words.textContent === text) return;
    const line = document.createElement("span");
    line.textContent = text;
    words.replaceChildren(line);
  }

  // Makes a long phrase smaller until it fits its place.
  function fit(text) {
    if (!sizes.has(text)) {
      let size = 0;
      const tooBig = () => words.scrollHeight > phrase.clientHeight + 2 || words.scrollWidth > phrase.clientWidth + 2;
      do phrase.dataset.fit = size;
      while (tooBig() && ++size < SMALLER);
      sizes.set(text, Math.min(size, SMALLER - 1));
    }
    phrase.dataset.fit = sizes.get(text);
  }

  function drawStep(session) {
    const step = session.last;
    const missing = step?.kind === "missing";
    const text = missing ? _("Step not measured.") : (step?.words ?? "");
    say(text);
    fit(text);
    emblem.dataset.emblem = missing ? "none" : (step?.emblem ?? "");
    const sign = step?.points ? signed(step.points) : "";
    emblem.dataset.long = Math.min(sign.length, 4);
    for (const element of signs) set(element, sign);
    if (step && step.number !== drawn && !isStill())
      emblem.animate([{ transform: "scale(.92)" }, { transform: "none" }], SWAP);
    drawn = step?.number ?? -1;
    set(said, step ? spoken(step, session) : "");
  }

  function drawTotals({ has_points, unit, score, streak, number, last }) {
    set(label, has_points ? _("Points") : fill(_("This step, in %(unit)s"), { unit }));
    const text = has_points ? count(score) : typeof last?.shown === "number" ? decimal(last.shown, 2) : "—";
    const before = shown;
    shown = score;
    if (set(key, text) && has_points && !isStill()) {
      key.animate([{ transform: `translateY(${score > before ? 8 : -8}%)` }, { transform: "none" }], ROLL);
    }
    key.dataset.long = Math.min(text.length, 6);
    run.dataset.streak = streak ?? "none";
    beads.forEach((bead, i) => bead.classList.toggle("on", streak > i));
    set(
      runWords,
      streak === null ? fill(_("Step %(number)s"), { number }) : n_("%(count)s in a row", "%(count)s in a row", streak),
    );
  }

  function drawPart(session) {
    const [done, left] = partLeft(session);
    part.toggleAttribute("data-open", done === null);
    bar.value = Math.min(done ?? 0, 1);
    set(partWords, left);
  }

  // Draws a look of the session; `why` says what ended the connection.
  return function draw(look, session, why) {
    if (session) set(time, timeLeft(session));
    if (session) body.dataset.chart = session.chart;
    if (look === "feedback") {
      drawStep(session);
      drawTotals(session);
      return;
    }
    const [text, more] = wordsFor(look, session, name, why);
    say(text);
    delete phrase.dataset.fit;
    set(sub, more);
    set(said, `${text} ${more}`);
    if (look === "calm") drawPart(session);
  };
}
