// The page's own words and number formats. What a step means comes in the server's words.

import { _, fill, n_, number } from "garry/shared/language";

const SAFE = _("Your score is safe.");

// Words for everything that is not a step: [the phrase, the line below it].
export function wordsFor(look, session, name, why) {
  const safe = session?.has_points === false ? "" : SAFE;
  switch (look) {
    case "ready":
      return [
        fill(_("Hello, %(name)s."), { name }),
        session.presence.source ? _("The sensor is ready.") : _("Waiting for the sensor."),
      ];
    case "begin":
      return [_("Begin to walk."), _("The sensor is ready.")];
    case "calm":
      return [session.phase.calm_words, session.has_points ? _("No score in this part.") : ""];
    case "waiting":
      return [_("Waiting for the sensor."), _("Please wait. No score yet.")];
    case "lost":
      return [_("The sensor is silent."), safe || _("Please wait.")];
    case "still":
      return [_("Waiting for your next step."), safe];
    case "paused":
      if (session.pause_reason === "restart") return [_("Pause."), _("The server was restarted; nothing was lost.")];
      if (session.pause_reason === "therapist") return [_("Pause."), `${_("Your therapist paused.")} ${safe}`];
      return [_("Pause."), `${_("Rest now.")} ${safe}`];
    case "ask":
      return [_("End this session?"), _("You cannot walk on after that.")];
    case "offline":
      return [_("No connection."), `${_("Please wait.")} ${safe}`];
    case "ended":
      return [_("This session has ended."), _("Your scores come next.")];
    case "closed":
      return [_("This screen has stopped."), why];
  }
  return ["", ""];
}

export const signed = (points) => (points < 0 ? `−${-points}` : `+${points}`);

// "−34"; an en dash in place of a hyphen would be narrower than the figures.
export const count = (points) => number(points);

export const clock = (seconds) => {
  const whole = Math.max(0, Math.ceil(seconds));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
};

export function timeLeft(session) {
  const planned = session.target.duration_s;
  if (session.state === "ready") return planned ? fill(_("%(time)s to walk"), { time: clock(planned) }) : "";
  if (!planned) return fill(_("%(time)s walked"), { time: clock(session.active_s) });
  return session.active_s < planned
    ? fill(_("%(time)s left"), { time: clock(planned - session.active_s) })
    : _("Time reached");
}

// How much of the phase is done (0 to 1; null where it has no end) and what is left, in words.
export function partLeft({ phase, phase_s, phase_strides }) {
  const limits = [];
  if (phase.seconds)
    limits.push([
      phase_s / phase.seconds,
      fill(_("%(time)s left in this part"), { time: clock(phase.seconds - phase_s) }),
    ]);
  if (phase.strides) {
    const left = Math.max(0, phase.strides - phase_strides);
    limits.push([
      phase_strides / phase.strides,
      n_("%(count)s step left in this part", "%(count)s steps left in this part", left),
    ]);
  }
  return limits.sort(([a], [b]) => b - a)[0] ?? [null, ""];
}

// One line for screen readers: "Strong push. Plus 2. 128 points."
export function spoken(step, session) {
  if (step.kind === "missing") return _("Step not measured.");
  const words = step.words && step.words.replace(/[!.]*$/, ".");
  if (step.points === null)
    return [words, step.shown !== null && `${number(step.shown, 2)} ${session.unit}.`].filter(Boolean).join(" ");
  const change =
    step.points &&
    fill(step.points > 0 ? _("Plus %(points)s.") : _("Minus %(points)s."), { points: Math.abs(step.points) });
  return [words, change, n_("%(score)s point.", "%(score)s points.", session.score, { score: count(session.score) })]
    .filter(Boolean)
    .join(" ");
}
