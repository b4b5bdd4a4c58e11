// A stride of the detector as a step of the protocol: rehab/sources/intake/measurements.py, from_wearable.

import { VERSION } from "garry/sensor/detector";

const toDegrees = (angle) => (angle === null ? null : (angle * 180) / Math.PI);

// Without times since 1970 but its own, which exports for research take the date off.
// `quality`: further named values, of the sensor; null where one is not known.
export function toStep(stride, place, side, quality = {}) {
  const stance_percent = (100 * stride.stance_s) / stride.stride_s;
  const extra = {
    [`wearable_${place}`]: VERSION,
    stride_s: stride.stride_s,
    stance_s: stride.stance_s,
    cadence_min: 120 / stride.stride_s,
    [`${place}_stance_percent`]: stance_percent,
    [`${place}_swing_percent`]: 100 - stance_percent,
    foot_strike_deg: toDegrees(stride.foot_strike_rad),
    push_off_deg_s: toDegrees(stride.push_off_rad_s),
    shank_lean_deg: toDegrees(stride.shank_lean_rad),
    sensor_rate_hz: stride.rate_hz,
    ...quality,
  };
  const known = Object.entries(extra).filter(([, value]) => value !== null);
  return { time_s: stride.end_s, side, value: null, reasons: stride.reasons, extra: Object.fromEntries(known) };
}
