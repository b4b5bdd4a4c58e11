// What the patient's page knows: the server's snapshot, kept current by its events. Nothing is counted here.

const KEPT_STRIDES = 60; // as many as a snapshot has
const TOTALS = ["number", "score", "active_s", "phase_s", "phase_strides", "has_points", "longest", "chart"];

export function fromSnapshot(snapshot) {
  const last = snapshot.last?.kind === "calm" ? null : snapshot.last;
  return { ...snapshot, last };
}

export function applyEvent(session, event) {
  for (const name of TOTALS) if (name in event) session[name] = event[name];
  switch (event.kind) {
    case "step":
    case "missing":
      session.steps = [...session.steps, { performance: null, ...event }].slice(-KEPT_STRIDES);
      // A late step changes totals and strides only. Steps of a pause are not shown at all.
      if (event.live && session.state === "running") session.last = event;
      break;
    case "calm":
      session.last = null;
      break;
    case "state":
      session.state = event.state;
      if (event.state === "running") session.fall_seen = false;
      session.pause_reason = event.pause_reason;
      break;
    case "phase":
      if (event.phase.theme !== session.phase.theme) session.last = null; // the last step was answered in another theme
      session.phase = event.phase;
      break;
    case "presence":
      session.presence = event.presence;
      break;
    case "alarms":
      session.fell = event.fell;
      session.fall_seen = event.fall_seen;
      break;
    case "robot_stopped":
      session.robot_stopped = event.stopped;
  }
}

// Return which screen to show. `page` is what only the page knows: its link ("open", "lost", "closed"),
// whether it is `asking` to end the session, and whether no step has come for a while (`still`).
export function screenOf(session, page) {
  if (page.link === "closed") return "closed";
  if (!session) return page.link === "lost" ? "offline" : "connecting";
  if (session.state === "finished" || session.state === "aborted") return "ended";
  if (page.link === "lost") return "offline";
  // Whoever fell stays until the walk goes on, which the therapist's page alone orders.
  if (session.fell || (session.fall_seen && session.state !== "running")) return "fell";
  if (session.state === "ready") return "ready";
  if (session.state === "paused") return page.asking ? "ask" : "paused";
  if (!session.presence.source) return session.number ? "lost" : "waiting";
  if (!session.phase.feedback) return page.still ? "still" : "calm";
  if (!session.number) return "begin";
  return page.still ? "still" : "feedback";
}
