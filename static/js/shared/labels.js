// Labels, in the page's language, of what the server sends by name: feedback types, phases, reasons, remarks.
// A name without a label stays as it is.
import { _ } from "garry/shared/language";

const TYPES = { positive: _("Positive"), negative: _("Negative"), binary: _("Binary"), explicit: _("Explicit") };
const PHASES = {
  Baseline: _("Baseline"),
  Familiarization: _("Familiarization"),
  Training: _("Training"),
  "Training 100 %": _("Training 100 %"),
  "Training 95 %": _("Training 95 %"),
  "Training 90 %": _("Training 90 %"),
  "Training 85 %": _("Training 85 %"),
  Catch: _("Catch"),
  Washout: _("Washout"),
  Retention: _("Retention"),
};
const REMARKS = {
  rest: _("rest"),
  pain: _("pain"),
  dizziness: _("dizziness"),
  near_fall: _("near fall"),
  fall: _("fall"),
  fall_severity: _("hurt by the fall"),
  fall_withdrawn: _("it was not a fall"),
  fall_acknowledged: _("fall seen by a therapist"),
  stop_acknowledged: _("robot’s stop seen by a therapist"),
  verbal_cue: _("verbal cue"),
  borg: _("exertion"),
  belt_speed: _("belt speed"),
  weight_support: _("body-weight support"),
  walking_aid: _("walking aid"),
  orthosis: _("orthosis"),
  handrail: _("handrail"),
  helping_hand: _("therapist’s hand"),
};
const SEVERITIES = [_("not hurt"), _("slightly hurt"), _("moderately hurt"), _("badly hurt")];
// Why a stride does not count (rehab/training/steps.py, rehab/gait/strides.py, rehab/gait/wearables/strides.py).
const REASONS = {
  missing: _("no value"),
  not_finite: _("no number"),
  out_of_bounds: _("out of bounds"),
  time_backwards: _("the sensor’s clock jumped"),
  paused: _("paused"),
  flagged: _("doubtful"),
  gap: _("samples are lost"),
  late: _("samples came late"),
  rate: _("another sampling rate"),
  force_lost: _("the force is missing"),
  force_too_large: _("the force is too large"),
  short_stance: _("stance too short"),
  long_stance: _("stance too long"),
  cut_off: _("cut off"),
  irregular: _("irregular step"),
  cross_step: _("crossed step"),
  weight: _("another weight"),
  moment_lost: _("the moment is missing"),
  moment_sign: _("the moment’s sign is turned"),
  moment_too_small: _("the moment is too small"),
  moment_too_large: _("the moment is too large"),
  moment_in_swing: _("moment in swing"),
  moment_out_of_step: _("the moment is out of step"),
  angle_lost: _("the angle is missing"),
  angle_flat: _("the angle is flat"),
  angle_too_large: _("the angle is too large"),
  angle_out_of_step: _("the angle is out of step"),
  power_reversed: _("the power’s sign is turned"),
  no_push_off: _("no push-off"),
  turning: _("the leg turned round"),
  interrupted: _("a pause in the walk"),
  samples_lost: _("samples are lost"),
  low_rate: _("too few samples a second"),
  contact_unclear: _("unclear when the foot lands"),
  sensor_moved: _("the sensor has moved"),
  doubt_weight: _("the plates do not carry the body mass"),
  doubt_angle: _("the angle is not an ankle’s"),
  doubt_moment: _("the moment’s zero is off"),
  doubt_load: _("the other plate is loaded"),
};

// What to do about the signals' clock: late, lost, drifting (rehab/gait/selfcheck/cures.py).
const CURES = {
  time_backwards: _("Send the sensors’ own times."),
  gap: _("Lost: look at the network and the recorder."),
  flag_lost: _("Lost: look at the network and the recorder."),
  late: _("Late: close other programs on the lab’s computer."),
  flag_late: _("Late, and put back: close other programs on the lab’s computer."),
  moment_out_of_step: _("Out of time or drifting: let one clock stamp all channels."),
  angle_out_of_step: _("Out of time or drifting: let one clock stamp all channels."),
};

// Why no stride counts until a person has looked: the cure (rehab/gait/selfcheck/checks.py).
const DOUBTS = {
  doubt_weight: _(
    "Plates and body mass disagree. Check mass, handrail and harness; if right, pause and go on: strides then count.",
  ),
  doubt_angle: _(
    "The angle moves as a knee’s does. Check the source’s columns; if right, pause and go on: strides then count.",
  ),
  doubt_moment: _(
    "The ankle’s moment is not zero in swing. Zero the plates before the lab computes it; if right, pause and go on.",
  ),
  doubt_load: _(
    "The other plate is loaded while one foot stands: cane, hand or dragging foot. If right, pause and go on.",
  ),
};

// Why strides of a worn sensor do not count: the cure.
const WORN_CURES = {
  contact_unclear: _("Strap the sensor as pictured, or tighter; of a recording try another one, or the other leg."),
  sensor_moved: _("Strap the sensor tighter."),
  samples_lost: _("Keep the sensor near its receiver; of a recording try another one."),
  low_rate: _("Charge the phone, and turn its power saving off."),
};

export const typeName = (slug, label = slug) => TYPES[slug] ?? label;
export const phaseName = (name) => PHASES[name] ?? name;
export const severityName = (severity) => SEVERITIES[severity] ?? REMARKS.fall_severity;
export const remarkName = (kind) => REMARKS[kind] ?? kind.replaceAll("_", " ");
export const clockCures = (names) => [...new Set(names.map((name) => CURES[name]).filter(Boolean))];
export const doubtCure = (reasons) => DOUBTS[reasons.find((reason) => reason in DOUBTS)] ?? "";
export const wornCure = (reason) => WORN_CURES[reason] ?? "";
export const reasonName = (reason) => REASONS[reason] ?? reason.replaceAll("_", " ");
