// The page's own words and number formats. What a step means comes in the server's words.

const SAFE = "Your score is safe.";

// Words for everything that is not a step: [the phrase, the line below it].
export function wordsFor(look, session, name, why) {
  const safe = session?.has_points === false ? "" : SAFE;
  switch (look) {
    case "ready":
      return [`Hello, ${name}.`, session.presence.source ? "The sensor is ready." : "Waiting for the sensor."];
    case "begin":
      return ["Begin to walk.", "The sensor is ready."];
    case "calm":
      return [session.phase.calm_words, session.has_points ? "No score in this part." : ""];
    case "waiting":
      return ["Waiting for the sensor.", "Please wait. No score yet."];
    case "lost":
      return ["The sensor is silent.", safe || "Please wait."];
    case "still":
      return ["Waiting for your next step.", safe];
    case "paused":
      if (session.pause_reason === "restart") return ["Pause.", "The server was restarted; nothing was lost."];
      if (session.pause_reason === "therapist") return ["Pause.", `Your therapist paused. ${safe}`];
      return ["Pause.", `Rest now. ${safe}`];
    case "ask":
      return ["End this session?", "You cannot walk on after that."];
    case "offline":
      return ["No connection.", `Please wait. ${safe}`];
    case "ended":
      return ["This session has ended.", "Your scores come next."];
    case "closed":
      return ["This screen has stopped.", why];
  }
  return ["", ""];
}

export const signed = (points) => (points < 0 ? `−${-points}` : `+${points}`);

// "−34"; an en dash in place of a hyphen would be narrower than the figures.
export const count = (number) => String(number).replace("-", "−");

export const clock = (seconds) => {
  const whole = Math.max(0, Math.ceil(seconds));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
};

export function timeLeft(session) {
  const planned = session.target.duration_s;
  if (session.state === "ready") return planned ? `${clock(planned)} to walk` : "";
  if (!planned) return `${clock(session.active_s)} walked`;
  return session.active_s < planned ? `${clock(planned - session.active_s)} left` : "Time reached";
}

// How much of the phase is done (0 to 1; null where it has no end) and what is left, in words.
export function partLeft({ phase, phase_s, phase_strides }) {
  const limits = [];
  if (phase.seconds) limits.push([phase_s / phase.seconds, `${clock(phase.seconds - phase_s)} left in this part`]);
  if (phase.strides) {
    const left = Math.max(0, phase.strides - phase_strides);
    limits.push([phase_strides / phase.strides, `${left} ${left === 1 ? "step" : "steps"} left in this part`]);
  }
  return limits.sort(([a], [b]) => b - a)[0] ?? [null, ""];
}

// One line for screen readers: "Strong push. Plus 2. 128 points."
export function spoken(step, session) {
  if (step.kind === "missing") return "Step not measured.";
  const words = step.words && step.words.replace(/[!.]*$/, ".");
  if (step.points === null) return [words, step.shown !== null && `${step.shown} ${session.unit}.`].filter(Boolean).join(" ");
  const change = step.points && `${step.points > 0 ? "Plus" : "Minus"} ${Math.abs(step.points)}.`;
  return [words, change, `${count(session.score)} points.`].filter(Boolean).join(" ");
}
