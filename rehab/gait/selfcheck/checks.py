"""Checks of signals during baseline: signs, units, weight and lag, with a cure for each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.offline import make_detector
from rehab.gait.one_leg import GRAVITY_M_S2
from rehab.gait.selfcheck.lag import find_deceleration_peak
from rehab.gait.selfcheck.leg_checks import check_force, check_strides
from rehab.gait.selfcheck.shapes import KNEE_LEAD, find_likeness, find_stances, make_profile
from rehab.gait.selfcheck.unloaded import find_moment_zero, find_other_load
from rehab.gait.signals.filters import Floats
from rehab.gait.signals.samples import LegSamples
from rehab.gait.stances.continuity import RATE_TOLERANCE
from rehab.gait.stances.lag_watch import BRAKING_S, find_pace
from rehab.gait.stances.plausibility import SUPPORTED_BELOW
from rehab.gait.strides import Stride

WEIGHT_ABOVE = 1.05  # shoes and instrumentation weigh up to 3 % (moore2013)
OWN_TOLERANCE_S = 0.003  # against the same person's earlier check
# Of the body mass, on both plates or twice one. Beyond, A2 is off by more than a tenth if it is the
# mass that is wrong, and not a handrail or, on one plate, a leg that is spared.
CERTAIN_LOAD = (0.9, 1.1)


@dataclass(frozen=True, slots=True)
class Finding:
    """Something to put right before training.

    Attributes
    ----------
    code, message
        What it is, for programs, and the cure, for people.
    side
        None where it concerns both legs.
    doubt
        The reason by which valid strides do not count until a person has looked, as none of them
        shows what is wrong; empty where strides may count.
    """

    code: str
    message: str
    side: str | None = None
    doubt: str = ""


@dataclass(frozen=True, slots=True)
class SignalCheck:
    """Result of a self-check.

    Attributes
    ----------
    findings
        What to put right; empty if nothing.
    strides, valid
        How many strides were seen, and how many of them are valid.
    rate_hz
        Median rate of the samples.
    weight_ratio
        Median force of both plates by body weight; None with one leg.
    lag_s
        By how much the angles come later than in an earlier check of this person [s] (mean of the
        legs), to 3 ms; None without one. Without one, a lag cannot be found: people differ by more.
    deceleration_s
        When each ankle brakes hardest after terminal contact [s] (``find_deceleration_peak``), by
        side. Store that of a session whose synchronization was measured, for later checks.
    """

    findings: tuple[Finding, ...]
    strides: int
    valid: int
    rate_hz: float
    weight_ratio: float | None
    lag_s: float | None
    deceleration_s: dict[str, float | None]


def check_signals(
    t_s: ArrayLike,
    left: LegSamples | Sequence[ArrayLike] | None,
    right: LegSamples | Sequence[ArrayLike] | None,
    *,
    rate_hz: float,
    mass_kg: float,
    own_deceleration_s: dict[str, float] | None = None,
    strides: list[Stride] | None = None,
    is_overground: bool = False,
) -> SignalCheck:
    """Return the check of signs, units, weight and force–kinematics lag of half a minute or more.

    Parameters
    ----------
    t_s, left, right
        As for ``TwoLegDetector.feed``; a leg that is not measured is None.
    rate_hz, mass_kg
        As for ``TwoLegDetector``.
    own_deceleration_s
        ``deceleration_s`` of an earlier check of this person, by side.
    strides
        Those of the signals, where they are measured already.
    is_overground
        As in ``DetectorSettings``; a few steps over plates weigh nobody.

    Raises
    ------
    GaitInputError
        For settings or channels that nothing can be measured from.
    """
    time = np.asarray(t_s, dtype=np.float64)
    legs = {"left": left, "right": right}
    given = {side: LegSamples(*leg) for side, leg in legs.items() if leg is not None}
    if strides is None:
        settings = {"is_overground": is_overground}
        detector = make_detector(given, rate_hz, mass_kg, **settings) if given else None
        strides = detector.feed_legs(time, given) if detector else []
    findings = _check_rate(time, rate_hz)
    decelerations: dict[str, float | None] = {}
    for side, leg in given.items():
        own = [stride for stride in strides if stride.side == side]
        force = np.asarray(leg.force_n, dtype=np.float64)
        found = check_force(force, own, mass_kg * GRAVITY_M_S2) + check_strides(own)
        decelerations[side] = find_deceleration_peak(time, leg.angle_rad, own)
        findings += [Finding(code, message, side) for code, message in found]
        findings += _check_joint(time, force, np.asarray(leg.angle_rad, dtype=np.float64), side)
        findings += _check_unloaded(time, leg, side, strides, mass_kg)
    ratios = [s.weight_ratio for s in strides if s.weight_ratio is not None]
    ratio = float(np.median(ratios)) if ratios else None
    findings += [] if is_overground else _check_weight(ratio, mass_kg)
    if len(given) == 1 and not is_overground:
        ((side, leg),) = given.items()
        findings += _check_load(
            _compute_mean_load(time, leg, strides) / GRAVITY_M_S2, mass_kg, side
        )
    lag_s = _find_lag(decelerations, own_deceleration_s or {})
    pace = find_pace(float(np.median([stride.stance_s for stride in strides] or [0.0])))
    findings += _check_lag(lag_s) if own_deceleration_s else _check_braking(decelerations, pace)
    return SignalCheck(
        findings=tuple(findings),
        strides=len(strides),
        valid=sum(stride.valid for stride in strides),
        rate_hz=_find_rate(time),
        weight_ratio=ratio,
        lag_s=lag_s,
        deceleration_s=decelerations,
    )


def _find_rate(time: Floats) -> float:
    steps = np.diff(time[np.isfinite(time)])
    steps = steps[steps > 0]
    return float(1 / np.median(steps)) if len(steps) else 0.0


def _check_rate(time: Floats, rate_hz: float) -> list[Finding]:
    real_hz = _find_rate(time)
    if abs(real_hz / rate_hz - 1) <= RATE_TOLERANCE:
        return []
    message = f"Samples come at {_round(real_hz)} Hz, not {_round(rate_hz)} Hz. "
    if real_hz < 10:
        message += "Send the times in seconds, not milliseconds, and let them count on."
    else:
        message += "Set the rate that the lab really sends."
    return [Finding("rate", message)]


def _round(rate_hz: float) -> str:
    return f"{rate_hz:.0f}" if rate_hz >= 10 else f"{rate_hz:.2g}"


def _check_weight(ratio: float | None, mass_kg: float) -> list[Finding]:
    if ratio is None or SUPPORTED_BELOW <= ratio <= WEIGHT_ABOVE:
        return []
    message = f"The plates carry {ratio * 100:.0f} % of {mass_kg:g} kg. Check the body mass"
    if ratio < 1:
        message += "; if it is right, a handrail or harness carries the rest, and A2 is lower"
    is_far = not CERTAIN_LOAD[0] <= ratio <= CERTAIN_LOAD[1]
    return [Finding("weight", message + ".", doubt="doubt_weight" if is_far else "")]


def _check_joint(time: Floats, force: Floats, angle: Floats, side: str) -> list[Finding]:
    """Check that an angle is an ankle's: a knee's gives valid strides too, and another A2."""
    profile = make_profile(time, angle, find_stances(time, force))
    if profile is None:
        return []
    like = find_likeness(profile)
    if abs(like["knee angle"]) < abs(like["angle"]) + KNEE_LEAD:
        return []
    message = "The angle moves as a knee's does, not as an ankle's. Check which column it is."
    return [Finding("angle_other", message, side, "doubt_angle")]


def _check_unloaded(
    time: Floats, leg: LegSamples, side: str, strides: list[Stride], mass_kg: float
) -> list[Finding]:
    """Check what a leg reads while its foot swings: its moment, and its plate's force."""
    own, others = ([s for s in strides if (s.side == side) == is_own] for is_own in (True, False))
    force, moment = (np.asarray(row, dtype=np.float64) for row in leg[:2])
    found = []
    if (zero := find_moment_zero(time, moment, own, mass_kg)) is not None:
        found.append(Finding("moment_zero", zero[0], side, "doubt_moment" if zero[1] else ""))
    zero_n = own[-1].offset_n if own else 0.0
    load = find_other_load(time, force, others, zero_n, mass_kg * GRAVITY_M_S2)
    if load is not None:
        other = others[0].side
        found.append(Finding("other_load", load[0], other, "doubt_load" if load[1] else ""))
    return found


def _compute_mean_load(time: Floats, leg: LegSamples, strides: list[Stride]) -> float:
    """Return the median of a plate's mean force over whole strides [N], NaN without one."""
    force = np.asarray(leg.force_n, dtype=np.float64)
    means = []
    for stride in strides:
        if stride.stride_s is not None:
            end_s = stride.initial_contact_s
            part = slice(*np.searchsorted(time, (end_s - stride.stride_s, end_s)))
            means.append(force[part].mean() - stride.offset_n)
    return float(np.median(means)) if means else math.nan


def _check_load(load_kg: float, mass_kg: float, side: str) -> list[Finding]:
    """Check the load of one leg: half of the weight, but a leg may be spared, so strides count."""
    share = load_kg / mass_kg
    low, high = CERTAIN_LOAD
    if not (2 * share < low or 2 * share > high):
        return []
    message = (
        f"The plate carries {share * 100:.0f} % of {mass_kg:g} kg over whole strides; half is "
        f"usual, that of {2 * load_kg:.1f} kg. Right for a leg that is spared or favored; else "
        "check the body mass."
    )
    return [Finding("weight_unusual", message, side)]


def _find_lag(decelerations: dict[str, float | None], own: dict[str, float]) -> float | None:
    """Return the mean lag of the legs [s]: both plates have one clock, both ankles another."""
    lags = [
        deceleration_s - own[side]
        for side, deceleration_s in decelerations.items()
        if deceleration_s is not None and side in own
    ]
    return float(np.mean(lags)) if lags else None


def _check_braking(decelerations: dict[str, float | None], pace: float) -> list[Finding]:
    """Check when the ankles brake, which is unusual but may be a person's own way to walk."""
    least_s, most_s = (pace * at_s for at_s in BRAKING_S)
    return [
        Finding(
            "timing_unusual",
            f"The {side} ankle brakes {at_s * 1000:.0f} ms after its foot has left; "
            f"{least_s * 1000:.0f} to {most_s * 1000:.0f} ms are known of people. This may be how "
            "this person walks. If plate and motion capture may be out of time, show it with a "
            "synchronization pulse or heel drops: A2 changes by about 1.4 % a millisecond.",
            side,
        )
        for side, at_s in decelerations.items()
        if at_s is not None and not least_s <= at_s <= most_s
    ]


def _check_lag(lag_s: float | None) -> list[Finding]:
    if lag_s is None or abs(lag_s) <= OWN_TOLERANCE_S:
        return []
    order = "later" if lag_s > 0 else "earlier"
    message = (
        f"The ankle angle comes about {abs(lag_s) * 1000:.0f} ms {order} than in this person's "
        "earlier check; 5 ms shift A2 by 6 to 8 %. Synchronize plate and motion capture."
    )
    return [Finding("lag", message)]
