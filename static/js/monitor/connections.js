// How well sensor, tablet and robot are heard, in words and a sign before them: ✓ well, ! look, – not there.

import { _, fill } from "garry/shared/language";

const SILENT_S = { stride: 5, tablet: 12 };
const ENOUGH = 0.8; // valid strides among the last 20; fewer and the goal is met by chance
const LAST = 20;

const ago = (seconds) =>
  seconds < 1.5
    ? _("now")
    : seconds < 90
      ? fill(_("%(count)s s ago"), { count: Math.round(seconds) })
      : fill(_("%(count)s min ago"), { count: Math.round(seconds / 60) });

// `waited_s`: seconds since `presence` was told.
export function quality({ presence, state }, strides, robot, waited_s) {
  const since = (seconds) => (seconds === null || seconds === undefined ? null : seconds + waited_s);
  return {
    source: ofSensor(presence.source, strides.slice(-LAST), since(presence.stride_ago_s), state === "running"),
    tablets: ofTablets(presence.tablets, since(presence.tablet_ago_s)),
    robot: presence.robot ? [robot.low ? "!" : "✓", robot.words] : ["–", _("none")],
  };
}

function ofSensor(there, last, heard, running) {
  if (!there)
    return [
      "–",
      heard === null ? _("not connected") : fill(_("not connected, last stride %(ago)s"), { ago: ago(heard) }),
    ];
  if (!last.length || heard === null) return ["✓", _("connected, no stride yet")];
  const valid = last.filter((stride) => stride.valid).length;
  const words = fill(_("%(valid)s of %(count)s valid, last %(ago)s"), { valid, count: last.length, ago: ago(heard) });
  if (running && heard > SILENT_S.stride) return ["!", fill(_("silent: %(words)s"), { words })];
  return [valid < ENOUGH * last.length ? "!" : "✓", words];
}

function ofTablets(count, heard) {
  if (!count) return ["–", _("none; only this mirror")];
  const many = count > 1 ? fill(_("%(count)s connected"), { count }) : _("connected");
  if (heard !== null && heard > SILENT_S.tablet)
    return ["!", fill(_("silent, last heard %(ago)s"), { ago: ago(heard) })];
  return ["✓", heard === null ? many : fill(_("%(what)s, heard %(ago)s"), { what: many, ago: ago(heard) })];
}
