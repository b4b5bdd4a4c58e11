// How well sensor, tablet and robot are heard, in text and a sign before it: ✓ well, ! needs a look, – not there.

import { _, fill } from "garry/shared/language";
import { ago } from "garry/shared/format";
import { SILENT_S } from "garry/monitor/state";

const ENOUGH = 0.8; // valid strides among the last 20; fewer and the goal is met by chance
const LAST = 20;

const describeSilence = (silent_s) => ["!", fill(_("silent, last heard %(ago)s"), { ago: ago(silent_s) })];

// What a worn sensor says of itself; its strides are invalid meanwhile.
const TROUBLES = {
  hidden: _("the phone is showing another page"),
  slow: _("the phone measures too slowly: charge it, turn off power saving"),
  gap: _("the phone missed samples"),
  moved: _("the sensor has moved: is the strap tight?"),
  elsewhere: _("it sits differently from last time: strap it on as before, or take a new baseline"),
  battery: _("the phone’s battery is low"),
  ended: _("the recording has ended"),
  doubt: _("unsure how it is worn: stand still, then lift the toes once (shin: swing the leg forward)"),
};

// Within which two phones' clocks have to agree for their steps to be compared (static/js/sensor/symmetry.js).
const AGREE_S = 0.01;

// A phone's clock: how far it is ahead of the server's, and how well that is known.
function describeClock(clock) {
  if (!clock) return "";
  const [ahead, error] = clock.map((seconds) => Math.round(1000 * seconds));
  return fill(_("clock %(ahead)s ± %(error)s ms"), { ahead: ahead > 0 ? `+${ahead}` : ahead, error });
}

// The phone on the leg that is not trained, and whether its steps can be compared.
function describeCompanion({ companion, companion_trouble: trouble, companion_clock: other, source_clock: own }) {
  if (!companion) return "";
  if (trouble) return fill(_("other leg: %(trouble)s"), { trouble: TROUBLES[trouble] });
  const isKnown = own && other && own[1] + other[1] <= AGREE_S;
  const words = [_("other leg: connected"), describeClock(other)];
  if (!isKnown) words.push(_("no symmetry: the phones’ clocks do not agree within 10 ms"));
  return words.filter(Boolean).join(", ");
}

// What walks in a trial instead of a leg (rehab/sessions/live/protocol/messages.py).
const PLAYED = { recording: _("recording"), simulated: _("simulated") };

function describePlayed({ source, source_plays: plays, source_round: round }) {
  if (!source) return "";
  return round > 1 ? fill(_("recording, round %(count)s"), { count: round }) : PLAYED[plays];
}

function describeAllSources(presence, strides, silent_s, isRunning) {
  const [sign, words] = describeSource(presence.source, strides, silent_s, isRunning, presence.source_trouble);
  const others = [describeClock(presence.source_clock), describeCompanion(presence)];
  const all = [describePlayed(presence), words, ...others].filter(Boolean);
  return [presence.companion_trouble && sign === "✓" ? "!" : sign, all.join(" · ")];
}

function describeSource(isThere, strides, silent_s, isRunning, trouble) {
  if (!isThere && trouble) return ["–", TROUBLES[trouble]];
  if (!isThere) {
    const since = silent_s !== null && fill(_("not connected, last stride %(ago)s"), { ago: ago(silent_s) });
    return ["–", since || _("not connected")];
  }
  if (trouble) return ["!", TROUBLES[trouble]];
  if (!strides.length || silent_s === null) return ["✓", _("connected, no stride yet")];
  if (isRunning && silent_s > SILENT_S.stride) return describeSilence(silent_s);
  const valid = strides.filter((stride) => stride.valid).length;
  const count = strides.length;
  const words = fill(_("%(valid)s of %(count)s valid, last %(ago)s"), { valid, count, ago: ago(silent_s) });
  return [valid < ENOUGH * count ? "!" : "✓", words];
}

function describeTablets(count, silent_s, isHeard) {
  if (!count) return ["–", _("none: the page is shown only here")];
  const what = count > 1 ? fill(_("%(count)s connected"), { count }) : _("connected");
  if (silent_s === null) return ["✓", what];
  if (!isHeard) return describeSilence(silent_s);
  return ["✓", fill(_("%(what)s, heard %(ago)s"), { what, ago: ago(silent_s) })];
}

export function createConnections({ state, show, socket, robot }) {
  const mirror = document.querySelector(".mirror");

  function describeAll({ presence, state: sessionState }) {
    if (socket.isStale()) {
      const unknown = ["–", fill(_("not known for %(count)s s"), { count: Math.floor(socket.silentFor() / 1000) })];
      return { source: unknown, tablets: unknown, robot: unknown };
    }
    const strides = state.strides.slice(-LAST);
    const { text, isLow } = robot.connection;
    return {
      source: describeAllSources(presence, strides, state.strideAgo_s, sessionState === "running"),
      tablets: describeTablets(presence.tablets, state.tabletAgo_s, state.isTabletHeard),
      robot: presence.robot ? [isLow ? "!" : "✓", text] : ["–", _("none")],
    };
  }

  return {
    draw(session) {
      const { about, presence } = session;
      const isSeen = state.isTabletHeard && !socket.isStale();
      show("mirror", isSeen ? fill(_("%(name)s sees"), { name: about.nickname }) : _("Patient’s page"));
      show("mirrored", isSeen ? _("now") : _("no screen"));
      mirror.classList.toggle("unseen", !isSeen);
      if (presence.source_plays) show("played", PLAYED[presence.source_plays]);
      const described = describeAll(session);
      for (const row of document.querySelectorAll("[data-presence]")) {
        const [sign, words] = described[row.dataset.presence];
        row.classList.toggle("there", sign !== "–");
        row.classList.toggle("low", sign === "!");
        const text = `${sign} ${words}`;
        const place = row.querySelector("small");
        if (place.textContent !== text) place.textContent = text;
      }
    },
  };
}
