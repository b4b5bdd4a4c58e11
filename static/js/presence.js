// How well sensor, tablet and robot are heard, in words and a sign before them: ✓ well, ! look, – not there.

const SILENT_S = { stride: 5, tablet: 12 };
const ENOUGH = 0.8; // valid strides among the last 20; fewer and the goal is met by chance
const LAST = 20;

const ago = (seconds) => (seconds < 1.5 ? "now" : seconds < 90 ? `${Math.round(seconds)} s ago` : `${Math.round(seconds / 60)} min ago`);

// `waited_s`: seconds since `presence` was told.
export function quality({ presence, state }, strides, robot, waited_s) {
  const since = (seconds) => (seconds === null || seconds === undefined ? null : seconds + waited_s);
  return {
    source: ofSensor(presence.source, strides.slice(-LAST), since(presence.stride_ago_s), state === "running"),
    tablets: ofTablets(presence.tablets, since(presence.tablet_ago_s)),
    robot: presence.robot ? [robot.low ? "!" : "✓", robot.words] : ["–", "none"],
  };
}

function ofSensor(there, last, heard, running) {
  if (!there) return ["–", heard === null ? "not connected" : `not connected, last stride ${ago(heard)}`];
  if (!last.length || heard === null) return ["✓", "connected, no stride yet"];
  const valid = last.filter((stride) => stride.valid).length;
  const words = `${valid} of ${last.length} valid, last ${ago(heard)}`;
  if (running && heard > SILENT_S.stride) return ["!", `silent: ${words}`];
  return [valid < ENOUGH * last.length ? "!" : "✓", words];
}

function ofTablets(count, heard) {
  if (!count) return ["–", "none; only this mirror"];
  const many = count > 1 ? `${count} connected` : "connected";
  if (heard !== null && heard > SILENT_S.tablet) return ["!", `silent, last heard ${ago(heard)}`];
  return ["✓", heard === null ? many : `${many}, heard ${ago(heard)}`];
}
