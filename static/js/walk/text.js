// The page's own texts. The feedback of a step comes as text from the server.

import { clock } from "garry/shared/format";
import { _, fill, n_, number } from "garry/shared/language";

const SAFE = _("Your score is safe.");
const KEEP_WALKING = _("Keep walking if you feel well.");
const sentences = (...all) => all.filter(Boolean).join("\n");

// Return what a screen without a step says: [the phrase, the line below it].
// `isAlone`: on a tablet that cannot go on by itself; `silent_s`: how long the server has said nothing.
export function messageFor(screen, session, name, { isAlone, silent_s }) {
  const safe = session?.has_points === false ? "" : SAFE;
  if (session?.presence.ended && (screen === "lost" || screen === "still"))
    return [_("The recording has ended."), safe];
  switch (screen) {
    case "ready":
      return [
        fill(_("Hello, %(name)s."), { name }),
        session.about?.own_goal
          ? fill(_("Your goal: %(goal)s"), { goal: session.about.own_goal })
          : session.presence.source
            ? _("The sensor is ready.")
            : _("Waiting for the sensor."),
      ];
    case "begin":
      return [_("Start walking."), _("The sensor is ready.")];
    case "calm":
      return [session.phase.calm_words, session.has_points ? _("No score in this part.") : ""];
    case "waiting":
      return [_("Waiting for the sensor."), _("Please wait. No score yet.")];
    case "lost":
      return [_("No signal from the sensor."), sentences(KEEP_WALKING, safe)];
    case "still":
      return [_("No steps measured."), sentences(KEEP_WALKING, safe)];
    case "paused":
      return [
        _("Pause."),
        sentences(
          _("Walk until the belt stops."),
          _("Then rest."),
          isAlone && _("Your therapist will start again."),
          safe,
        ),
      ];
    case "ask":
      return [_("End this session?"), safe];
    case "offline":
      return [fill(_("No connection for %(count)s s."), { count: silent_s }), KEEP_WALKING];
    case "fell":
      return [_("Stay where you are."), session.fell ? _("The team was called.") : _("Help is coming.")];
    case "ended":
      return [_("You have finished."), _("Next: your scores.")];
    case "closed":
      return [_("This screen has stopped."), _("Please call your therapist.")];
  }
  return ["", ""];
}

const timer = (seconds) => clock(Math.max(0, Math.ceil(seconds)));

export function timeLeft(session) {
  const planned = session.target.duration_s;
  if (session.state === "ready") return planned ? fill(_("%(time)s to walk"), { time: timer(planned) }) : "";
  if (!planned) return fill(_("%(time)s walked"), { time: timer(session.active_s) });
  return session.active_s < planned
    ? fill(_("%(time)s to go"), { time: timer(planned - session.active_s) })
    : _("Time reached");
}

// Return how much of the phase is done (0 to 1; null where it has no end), and a text of what is left.
export function phaseLeft({ phase, phase_s, phase_strides }) {
  const limits = [];
  if (phase.seconds)
    limits.push([
      phase_s / phase.seconds,
      fill(_("%(time)s to go in this part"), { time: timer(phase.seconds - phase_s) }),
    ]);
  if (phase.strides) {
    const left = Math.max(0, phase.strides - phase_strides);
    limits.push([
      phase_strides / phase.strides,
      n_("%(count)s step to go in this part", "%(count)s steps to go in this part", left),
    ]);
  }
  return limits.sort(([a], [b]) => b - a)[0] ?? [null, ""];
}

const NOT_MEASURED = _("Not seen.");

// Return whether the words after a step name the goal: without points, beside the value.
export const namesGoal = (step) => typeof step?.goal === "number" && !step.words && step.kind !== "missing";

// Return the words after a step.
export function phraseOf(step) {
  if (step?.kind === "missing") return NOT_MEASURED;
  return namesGoal(step) ? fill(_("Goal: %(goal)s"), { goal: number(step.goal, 2) }) : (step?.words ?? "");
}

let widestGoal = 8.88; // so far: where one step names none, the words' place stays

// Return the longest phrases that may follow a step, and a number as wide as most.
export function samplesOf(session) {
  const goal = session?.last?.goal;
  if (typeof goal === "number") widestGoal = Math.max(widestGoal, Number(goal.toFixed(2).replace(/\d/g, "8")));
  const phrases = [NOT_MEASURED, phraseOf({ goal: widestGoal }), ...(session?.longest ?? [])];
  return { phrases, number: session?.has_points === false ? number(6.66, 2) : "666" };
}

// Return one line for screen readers: "Well above. Plus 2. 128 points."
export function describeStep(step, session) {
  const words = phraseOf(step).replace(/[!.]*$/, ".");
  if (step.kind === "missing") return words;
  if (step.points === null)
    return [words, step.shown !== null && `${number(step.shown, 2)} ${session.unit}.`].filter(Boolean).join(" ");
  const change =
    step.points &&
    fill(step.points > 0 ? _("Plus %(points)s.") : _("Minus %(points)s."), { points: Math.abs(step.points) });
  return [words, change, n_("%(score)s point.", "%(score)s points.", session.score, { score: number(session.score) })]
    .filter(Boolean)
    .join(" ");
}

// Return what a block of steps came to.
export function describeSummary({ hits, steps, close }) {
  return close
    ? fill(_("%(hits)s of %(steps)s steps, %(close)s close"), { hits, steps, close })
    : fill(_("%(hits)s of %(steps)s steps"), { hits, steps });
}
