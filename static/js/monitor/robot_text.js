// What a robot's reasons and states are called on the PT's page.

import { _, fill } from "garry/shared/language";
import { notReaching, percent } from "garry/shared/format";

// Why it does not move, or did not end what it began.
const REASONS = {
  no_gesture: _("no gesture for that"),
  off: _("the robot is off"),
  only_informs: _("this feedback only informs"),
  late: _("the steps came late"),
  performing: _("still moving"),
  resting: _("resting"),
  unknown_gesture: _("it does not know this gesture"),
  bad_gesture: _("it cannot perform the gesture; compose it anew"),
  base_cannot_move: _("this robot cannot move"),
  stopped: _("it was stopped"),
  disarmed: _("nobody has let it move yet"),
  away_from_home: _("away from its place"),
  no_session: _("no session"),
  not_running: _("the session does not run"),
  unwatched: _("no therapist's page is open"),
  base_silent: _("its wheels do not answer"),
  order_lapsed: _("its orders came too late"),
  battery_low: _("its battery is low"),
  battery_empty: _("its battery is empty"),
  charging: _("it is charging"),
  bump: _("it bumped into something"),
  cliff: _("there is an edge"),
  wheel_drop: _("a wheel hangs free"),
  over_current: _("a wheel is blocked"),
  stalled: _("a wheel is blocked"),
  tether: _("it went too far from its place"),
  slipped: _("it slipped"),
  button: _("its stop button was pressed"),
  restarted: _("it was switched off and on"),
  nobody_listens: _("its driver program does not run"),
  feeler_missing: _("a sensor that protects it is missing"),
  nobody_watches: _("nothing would stop it if the connection were lost"),
  wrong_mode: _("its driver does not let it drive"),
  other_driver: _("another program drives it"),
  unordered_motion: _("something moved it"),
  open_loop: _("too far for a robot that does not know where it is"),
  place_unknown: _("nobody has checked for a while that it is on its mark"),
  firmware_unknown: _("the base's version is not known yet"),
  firmware_refused: _("the base's version is too old"),
  paused: _("the session paused"),
  finished: _("the session ended"),
  aborted: _("the session ended"),
  out_of_time: _("it did not get there in time"),
  bad_odometry: _("it does not know where it is"),
  no_link: _("the connection was lost"),
  replaced: _("another session began"),
  base_lost: _("its wheels were lost"),
  worker_died: _("its program died"),
};

// What it does, by its gesture, or by the pool of a gesture that is a variant.
const GESTURES = {
  celebrate: _("it celebrates"),
  droop: _("it droops"),
  nod: _("it nods"),
  sway: _("it sways"),
  greeting: _("it greets"),
  rest: _("it rests"),
  farewell: _("it says goodbye"),
  idle: _("it moves a little while it waits"),
  joy: _("it celebrates"),
  streak_3: _("it celebrates 3 in a row"),
  streak_5: _("it celebrates 5 in a row"),
  streak_10: _("it celebrates 10 in a row"),
  comeback: _("it celebrates the comeback"),
  near_miss: _("it shows that this was close"),
  effort: _("it rewards the effort"),
  disappointment: _("it droops"),
};

// What has to be done before it may move again.
const CURES = {
  away_from_home: _("Carry it back to its mark, facing as before."),
  bump: _("Clear its way."),
  cliff: _("Move it away from the edge."),
  wheel_drop: _("Put it down on both wheels."),
  over_current: _("Free its wheels."),
  stalled: _("Free its wheels."),
  slipped: _("Check the floor and its wheels."),
  base_silent: _("Check its switch and its cable."),
  charging: _("Take it off the charger."),
  battery_low: _("Charge it."),
  battery_empty: _("Charge it."),
  button: _("Let go of its button."),
  nobody_listens: _("Start its driver."),
  feeler_missing: _("Start its driver."),
  nobody_watches: _("Start the watchdog relay beside its driver."),
  wrong_mode: _("Switch its driver to navigation mode."),
  other_driver: _("Stop the other program."),
  unordered_motion: _("Stop other programs that drive it, and do not push it."),
};
// How its way home by a tag goes, or why it stands.
const HOMING = {
  looking: _("It looks for its tag."),
  searching: _("It looks around for its tag."),
  driving: _("It drives to its mark."),
  there: _("It is on its mark. Look, then let it move."),
  no_camera: _("Its camera does not answer. Check the cable."),
  camera_silent: _("Its camera does not answer. Check the cable."),
  camera_slow: _("Its camera is too slow. Switch on more light."),
  camera_dark: _("Its camera sees nothing. Uncover it, switch on the light."),
  camera_changed: _("Its camera is another one. Teach it its place anew."),
  no_tag: _("It does not see its tag. Turn it towards the tag, or carry it back."),
  two_tags: _("It sees its tag twice. Take one away."),
  tag_moves: _("Its tag moves. Fix it."),
  tag_not_level: _("Its tag hangs differently than before. Put it right, or teach it its place anew."),
  tag_contradicted: _("What it sees and how it rolled do not fit. Check its tag and its wheels."),
  tag_unsure: _("It cannot tell its mark surely enough by its tag. Drive it there by hand."),
  too_far: _("It is too far away. Carry it nearer."),
  home_not_reached: _("It did not get exactly to its mark. Drive it there by hand."),
};
const STATES = {
  idle: _("waiting"),
  performing: _("moving"),
  stopped: _("stopped"),
  disarmed: _("waits until you let it move"),
  away: _("away from its place"),
};

export const describeReason = (reason) => REASONS[reason] ?? reason;
export const cureOf = (reason) => CURES[reason] ?? "";
export const describeHoming = (code) => (code ? (HOMING[code] ?? code) : "");
// The name of a variant ends with its number; a clinic's own gesture has the name that they gave it.
export const describeGesture = (name) => GESTURES[name.replace(/_\d+$/, "")] ?? name;
export const describeState = (state) => STATES[state] ?? state;

// What a window came to and what followed; `breakReason`: why the gesture after it did not end as it should.
export function describeDecision(decision, breakReason) {
  if (!decision) return _("While the patient walks, it responds every five seconds.");
  const { mean, threshold, gesture, intensity, pool, reason } = decision;
  const size = intensity == null || intensity === 1 ? "" : fill(_(" at %(share)s"), { share: percent(intensity) });
  const end = breakReason && fill(_(", broken off: %(why)s"), { why: describeReason(breakReason) });
  return fill(_("Last five seconds: %(mean)s of the goal. Last answer: %(what)s."), {
    mean: percent(notReaching(mean, threshold)),
    what: gesture ? describeGesture(gesture) + (pool ? "" : size) + end : describeReason(reason),
  });
}
