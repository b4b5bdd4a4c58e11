// A step as text, emblem and number, and every other text of the page. Draws only what has changed.

import { signed } from "garry/shared/format";
import { _, fill, number as format } from "garry/shared/language";
import { isStill } from "garry/walk/reduced_motion";
import { describeStep, describeSummary, messageFor, namesGoal, phaseLeft, phraseOf, timeLeft } from "garry/walk/text";
import { writeTotal } from "garry/walk/total";

const ROLL = { duration: 300, easing: "cubic-bezier(.2, .8, .2, 1)" };
const SWAP = { duration: 200, easing: "cubic-bezier(.2, .8, .2, 1)" };

const rosette = Array.from({ length: 240 }, (_, i) => {
  const angle = (Math.PI * i) / 120;
  const radius = 134 + 10 * Math.cos(12 * angle);
  return `${(150 + radius * Math.cos(angle)).toFixed(1)} ${(150 + radius * Math.sin(angle)).toFixed(1)}`;
}).join("L");

export function createFeedback(body) {
  const find = (selector) => body.querySelector(selector);
  const [words, sub, live] = [".words", ".sub", ".said"].map(find);
  const [label, counts, summary, key] = [".label", ".label .name", ".summary", ".key"].map(find);
  const [time, part, bar, partWords] = [".time", ".part", ".part progress", ".part p"].map(find);
  const emblem = find(".emblem svg");
  const signs = emblem.querySelectorAll("text");
  const name = find("header b").textContent.trim();
  let drawnNumber = -1;
  let shownScore = 0; // the score
  find(".gain path").setAttribute("d", `M${rosette}Z`);

  function set(element, text) {
    if (element.textContent === text) return false;
    element.textContent = text;
    return true;
  }

  function setLines(element, text) {
    const lines = text.split("\n");
    if (element.textContent === lines.join(" ")) return;
    const spans = lines.map((line) => Object.assign(document.createElement("span"), { textContent: line }));
    element.replaceChildren(...spans.flatMap((span, i) => (i ? [" ", span] : [span])));
  }

  function drawStep(session) {
    const step = session.last;
    setLines(words, phraseOf(step));
    body.toggleAttribute("data-goal-named", namesGoal(step));
    emblem.dataset.emblem = step?.kind === "missing" ? "none" : (step?.emblem ?? "");
    emblem.toggleAttribute("data-hit", Boolean(session.has_points && step?.hit && !step.close));
    const isMoreWanted = step?.points === 0 && !step.hit && !step.close;
    emblem.toggleAttribute("data-more", isMoreWanted);
    const sign = step?.points ? signed(step.points) : "";
    emblem.dataset.long = Math.min(sign.length, 4);
    for (const element of signs) set(element, sign);
    if (sign || isMoreWanted) label.dataset.sign = sign || "▲";
    else delete label.dataset.sign;
    if (step && step.number !== drawnNumber && !isStill())
      emblem.animate([{ transform: "scale(.92)" }, { transform: "none" }], SWAP);
    drawnNumber = step?.number ?? -1;
    set(live, step ? describeStep(step, session) : "");
  }

  function drawTotals({ has_points, unit, score, last }) {
    const counted = has_points ? _("Points") : _("This step");
    if (has_points || last?.summary) delete label.dataset.unit;
    else label.dataset.unit = unit;
    set(counts, last?.summary ? `${counted} · ` : counted);
    set(summary, last?.summary ? describeSummary(last.summary) : "");
    const text = has_points ? format(score) : typeof last?.shown === "number" ? format(last.shown, 2) : "—";
    const before = shownScore;
    shownScore = score;
    if (writeTotal(key, text, has_points) && has_points && !isStill()) {
      key.animate([{ transform: `translateY(${score > before ? 8 : -8}%)` }, { transform: "none" }], ROLL);
    }
  }

  function drawPart(session) {
    const [done, left] = phaseLeft(session);
    part.toggleAttribute("data-open", done === null);
    bar.value = Math.min(done ?? 0, 1);
    set(partWords, left);
  }

  // Draw a screen of the session.
  return function draw(screen, session, page) {
    if (session) set(time, timeLeft(session));
    if (session) body.dataset.chart = session.chart;
    if (screen === "feedback") {
      drawStep(session);
      drawTotals(session);
      return;
    }
    const [text, more] = messageFor(screen, session, name, {
      isAlone: body.classList.contains("alone"),
      silent_s: page.silent_s,
    });
    setLines(words, text);
    setLines(sub, more);
    set(live, `${text} ${more}`);
    if (screen === "calm") drawPart(session);
  };
}
