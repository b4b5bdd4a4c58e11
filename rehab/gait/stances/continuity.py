"""Whether the samples of a stance are continuous: gaps, frozen values, jumps, spikes and steps.

These are faults of sensors and of their connection; physiological limits are checked in
``plausibility``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rehab.gait.signals.filters import Floats, find_maximum, find_minimum, find_upper_median
from rehab.gait.signals.samples import ANGLE, FORCE, MOMENT
from rehab.gait.stances.gaps import GAP_S, HARMFUL_FROM, StanceClock
from rehab.gait.stances.kinetics import PushOff
from rehab.gait.stances.resampling import ResampledStance
from rehab.gait.strides import RejectionReason

RATE_TOLERANCE = 0.2
# One value repeated for this long is no measurement. The moment changes all through stance; the
# angle rests where the ankle turns, but not to the last digit.
MOMENT_FROZEN_S, ANGLE_FROZEN_S = 0.02, 0.04
# A gap that was filled with a straight line before it was sent: 60 ms without a bend of so much a
# second squared, in late stance [Nm, rad]; noise, and walkers, bend by a hundred times that.
STRAIGHT_S = 0.06
STRAIGHT_TO = np.array([[4.0], [0.02]])
# At once [Nm/kg, rad], and by time: the six people of ``plausibility`` reach 13-23 Nm/kg/s and 4-9
# rad/s, and gaitalytics' unfiltered moment 0.37 Nm/kg at once. Beyond, a channel is no ankle's; of
# less, ``find_breaks`` judges.
MOMENT_JUMP = (0.5, 40.0)
ANGLE_JUMP = (0.2, 15.0)

# Spikes and steps are looked for h = 10 ms apart: in the angle by its fourth difference, to which a
# push-off adds little however fast it is, a spike six and a step three times its size; in the
# moment, which falls steeply, by the change of its distance from its own smooth curve. Of both a
# walker makes less than k × range × (h / stance)², since the curves of walkers differ in size and
# in the time that they take more than in form. Added to that: a constant, and a multiple of the
# median, for the sensor's noise. Beyond these, where nothing was wrong, k was for the angle 0
# (BTK's two), 40 (moore2013, OpenSim's subject01) and 225 (gaitalytics, unfiltered) at most; for
# the moment 110 (moore2013; synthetic people of 0.3 to 6.5 W/kg) and 37 (BTK's motion3). Eight
# medians are 5.4 sd of white noise, once in 10 million samples, and six 4 sd: 25 Nm in a moment of
# noise are told by these (``tests/gait/test_bad_input.py``). Of the unfiltered angles that the
# markers of four people make (gaitalytics, BTK's two, HBM's) none exceeds k, of gaitalytics' own
# the largest is 7.6 medians beyond it. A step beyond all that refuses the stride, a spike
# only where A2 changes once it is taken out (``SPIKES_SHARE``).
APART_S = 0.01
ANGLE_FOURTH = (350.0, 0.01, 8.0)  # rad
MOMENT_STEP = (110.0, 0.02, 6.0)  # Nm/kg
WHOLE = 3  # h on each side of a spike or step, which samples of uneven times smear
SPIKES_SHARE = 0.05  # of A2: more makes it another value; less is added to its standard deviation
SPIKE = 0.5  # of a step that does not stay: then it was a spike, of which nothing stays
MOMENT_TO_S = 0.02  # before its end; a moment that is computed from the force ends with a step


class Moving(NamedTuple):
    """Moment and angle around a stance, and how they change from sample to sample.

    Attributes
    ----------
    values, steps
        Shape (2, n), and their differences, shape (2, n - 1).
    jumps
        The largest of these of each; not finite where values are missing.
    """

    values: Floats
    steps: Floats
    jumps: tuple[float, float]

    @property
    def is_known(self) -> bool:
        """Whether no value is missing."""
        return math.isfinite(sum(self.jumps))


def read_moving(window: Floats) -> Moving:
    """Return moment and angle of a window, shape (4 or more, n), and how they change."""
    values = window[MOMENT : ANGLE + 1]
    steps = values[:, 1:] - values[:, :-1]
    most, least = steps.argmax(axis=1).tolist(), steps.argmin(axis=1).tolist()
    moment = max(steps.item(0, most[0]), -steps.item(0, least[0]))
    angle = max(steps.item(1, most[1]), -steps.item(1, least[1]))
    return Moving(values, steps, (moment, angle))


def check_samples(
    moving: Moving,
    stance: int,
    clock: StanceClock,
    rate_hz: float,
    mass_kg: float,
) -> list[RejectionReason]:
    """Return what is wrong with the samples of a stance, before anything is measured from them.

    Parameters
    ----------
    moving
        Moment and angle.
    stance
        The sample at which the stance begins.
    clock
        The stance's clock.
    rate_hz, mass_kg
        Nominal rate, and body mass.
    """
    reasons = []
    count = len(clock.kinetics_s) - stance
    samples = clock.taken_s * rate_hz
    if clock.lost_s <= GAP_S and abs((count - 1) / samples - 1) > RATE_TOLERANCE:
        reasons.append(RejectionReason.RATE)
    for row, frozen_s, scale, (at_once, by_time), reason in (
        (0, MOMENT_FROZEN_S, mass_kg, MOMENT_JUMP, RejectionReason.MOMENT_LOST),
        (1, ANGLE_FROZEN_S, 1.0, ANGLE_JUMP, RejectionReason.ANGLE_LOST),
    ):
        values, moved = moving.values[row, stance:], moving.steps[row, stance:]
        if not moving.jumps[row] <= scale * (at_once + by_time / rate_hz):
            time = clock.kinetics_s[stance:]
            known = np.flatnonzero(np.isfinite(values))
            if len(known) < count:
                if _has_gap(time, known):
                    reasons.append(reason)
                    continue
                time, values = time[known], values[known]
                moved = np.diff(values)
            taken = np.maximum(np.diff(time), 1 / rate_hz)
            if (np.abs(moved) > scale * (at_once + by_time * taken)).any():
                reasons.append(reason)
                continue
        if _is_frozen(values, moved, frozen_s * rate_hz):
            reasons.append(reason)
    return reasons


def check_fills(steps: Floats, rate_hz: float) -> list[RejectionReason]:
    """Return in which channels of a late stance a straight line stands for the walker's curve.

    Parameters
    ----------
    steps
        By how much moment and angle change from sample to sample, from where a fault harms A2 until
        terminal contact, shape (2, n).
    rate_hz
        Of the samples.
    """
    least = max(3, round(STRAIGHT_S * rate_hz) - 1)
    limits = _find_straight(rate_hz)
    # So long a line has one of these bends in it.
    bends = steps[:, least::least] - steps[:, least - 1 : -1 : least]
    if not np.count_nonzero(np.abs(bends) <= limits):
        return []
    straight = np.abs(steps[:, 1:] - steps[:, :-1]) <= limits
    reasons = (RejectionReason.MOMENT_LOST, RejectionReason.ANGLE_LOST)
    return [
        reason
        for reason, row in zip(reasons, straight, strict=True)
        if row.sum() >= least and _find_longest_run(row) >= least
    ]


@cache
def _find_straight(rate_hz: float) -> Floats:
    return STRAIGHT_TO / rate_hz**2


def _find_longest_run(found: NDArray[np.bool_]) -> int:
    """Return how many true values follow each other at most."""
    others = np.flatnonzero(~np.concatenate(([False], found, [False])))
    return int(np.diff(others).max()) - 1


class Breaks(NamedTuple):
    """Which channels of a stance have steps that stay, which spikes alone; it without these."""

    steps: list[RejectionReason]
    spikes: list[RejectionReason]
    without: ResampledStance


def find_breaks(stance: ResampledStance, push_off: PushOff, gap_s: float) -> Breaks:
    """Return where the channels of a stance are not continuous.

    After a step that stays a channel contradicts itself: time or an offset was lost, and nobody
    knows how much. Of a spike, what it does to A2 judges the stance: people's channels differ in
    noise more than in that.

    Parameters
    ----------
    stance
        With moment and angle.
    push_off
        What was measured of the stance.
    gap_s
        Longest time between two samples: over it, a straight line stands for the walker's curve.
    """
    apart = max(1, round(APART_S * stance.rate_hz))
    apart_s = apart / stance.rate_hz
    duration_s = stance.end_s - stance.begin_s
    walking = apart_s * max(apart_s, (apart_s + gap_s) / 2) / duration_s**2
    first = stance.index(HARMFUL_FROM)
    last = stance.end + 1 - round(MOMENT_TO_S * stance.rate_hz)
    angle = stance.signals[ANGLE - FORCE, first:]
    if last - first <= apart or len(angle) <= 4 * apart:
        return Breaks([], [], stance)
    found = []
    smooth = np.array([push_off.moment_nm_kg * push_off.mass_kg, push_off.angle_rad])
    rough = stance.signals[MOMENT - FORCE :] - smooth
    moment = push_off.moment_nm_kg[first:last]
    moved = rough[0, first:last] / push_off.mass_kg
    steps = np.abs(moved[apart:] - moved[:-apart])
    if (limit := _find_limit(steps, moment, walking, *MOMENT_STEP)) is not None:
        found.append((RejectionReason.MOMENT_LOST, 0, limit * push_off.mass_kg, last))
    bends = angle[2 * apart :] - 2 * angle[apart:-apart]
    bends += angle[: -2 * apart]
    fourth = bends[2 * apart :] - 2 * bends[apart:-apart]
    fourth += bends[: -2 * apart]
    if (limit := _find_limit(np.abs(fourth), angle, walking, *ANGLE_FOURTH)) is not None:
        found.append((RejectionReason.ANGLE_LOST, 1, limit / 6, len(push_off.angle_rad)))
    breaks = Breaks([], [], stance)
    if not found:
        return breaks
    signals = stance.signals.copy()
    before = max(0, first - 4 * apart)
    for reason, row, least, stop in found:
        values = signals[MOMENT - FORCE + row, before:]
        steps, stays = _find_steps(values, rough[row, before:], apart, least, stop - before)
        values -= steps
        (breaks.steps if stays else breaks.spikes).append(reason)
    return breaks._replace(without=replace(stance, signals=signals))


def _find_limit(
    found: Floats,
    curve: Floats,
    walking: float,
    by_walking: float,
    at_once: float,
    by_noise: float,
) -> float | None:
    """Return what walking and noise make of changes at most, None if the largest is no more."""
    highest = find_maximum(found)
    if not highest > at_once:
        return None
    walking *= find_maximum(curve) - find_minimum(curve)
    limit = by_walking * walking + at_once
    if not highest > limit:
        return None
    limit = limit + by_noise * find_upper_median(found)
    return limit if highest > limit else None


def _find_steps(
    values: Floats, rough: Floats, apart: int, least: float, stop: int
) -> tuple[Floats, bool]:
    """Return the steps of a channel, added up from its first sample on, and whether one stays.

    A step is what a change over ``apart`` samples has beyond the median of five such changes in a
    row. It is taken, with its neighbors, where it is ``least`` or more in what the channel has
    beside its smooth curve (``rough``), and before sample ``stop``. A spike has two, of which
    nothing stays.
    """
    added, stays = np.zeros_like(values), False
    if len(values) <= 5 * apart:
        return added, stays
    near = np.abs(_find_changes(rough, apart)) >= least
    near = np.convolve(near, np.ones(2 * WHOLE * apart + 1), "same") >= 1
    beyond = np.where(near, _find_changes(values, apart), 0.0)
    edges = np.flatnonzero(np.diff(near, prepend=False, append=False))
    for first, last in edges.reshape(-1, 2).tolist():
        part = beyond[first:last]
        if abs(float(part.sum())) / apart < SPIKE * float(np.abs(part).max()):
            part -= part.mean()
        else:
            stays = True
    begin = 2 * apart + (apart + 1) // 2  # in the middle of the change
    added[begin : begin + len(beyond)] = beyond / apart
    added[stop:] = 0.0
    return np.cumsum(added), stays


def _find_changes(values: Floats, apart: int) -> Floats:
    """Return each change over ``apart`` samples beyond the median of five of these in a row."""
    moved = values[apart:] - values[:-apart]
    in_a_row = np.lib.stride_tricks.sliding_window_view(moved, 4 * apart + 1)[:, ::apart]
    return np.asarray(moved[2 * apart : -2 * apart] - np.median(in_a_row, axis=1))


def _has_gap(time_s: Floats, known: NDArray[np.intp]) -> bool:
    """Return whether more is missing than may be bridged, given the indices of what is known."""
    if len(known) < 2 or known[-1] < len(time_s) - 1:
        return True
    holes = np.diff(time_s[known]).max()
    return bool(max(holes, time_s[known[0]] - time_s[0]) > GAP_S)


def _is_frozen(values: Floats, steps: Floats, longest: float) -> bool:
    """Return whether a channel repeats one value, not zero, for more than ``longest`` samples."""
    least = max(2, math.ceil(longest))
    some = steps[least - 1 :: least]  # so long a rest has one of these in it
    if np.count_nonzero(some) == len(some):
        return False
    still = steps == 0
    still &= values[1:] != 0
    edges = np.concatenate(([-1], np.flatnonzero(~still), [len(still)]))
    return bool(np.diff(edges).max() - 1 >= least)
