"""One stance: its samples taken from the buffer, checked and measured."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rehab.gait.contacts.force_plate import Contact
from rehab.gait.signals.buffer import LegBuffer
from rehab.gait.signals.filters import Floats, ZeroPhaseFilter, find_maximum
from rehab.gait.signals.samples import ANGLE, FORCE, FORWARD, MOMENT, POSITION, TIME
from rehab.gait.stances.continuity import check_samples, check_steps
from rehab.gait.stances.kinetics import PushOff, PushOffAnalyzer
from rehab.gait.stances.plausibility import (
    STANCE_MAX_S,
    STANCE_MIN_S,
    check_force,
    check_lever,
    check_push_off,
)
from rehab.gait.stances.resampling import resample_stance
from rehab.gait.strides import RejectionReason

BEFORE_S = 0.25  # of swing: for the filter to settle, and for the check of the moment in swing
LONGEST_S = BEFORE_S + STANCE_MAX_S + 1.0
# Neighbors are averaged down to 200-400 Hz before the filter: signals up to 6 Hz lose nothing.
DECIMATED_HZ = 200.0
FORWARD_HZ = 20.0


@dataclass(frozen=True, slots=True)
class Stance:
    """What was measured of a stance. Without a push-off there is a reason.

    Attributes
    ----------
    reasons
        Why it is invalid.
    push_off
        At its end.
    propulsion_n_kg
        Largest forward force of the second half of stance.
    position_m
        Of the foot at initial contact [m, forward].
    """

    reasons: list[RejectionReason]
    push_off: PushOff | None
    propulsion_n_kg: float | None
    position_m: float | None


class StanceAnalyzer:
    """Checks and measures the stances of one leg.

    Parameters
    ----------
    buffer, rate_hz
        The samples with their nominal rate.
    mass_kg, weight_n
        Body mass, and weight [N].
    cutoff_hz, is_velocity
        As in ``StrideDetector``.
    """

    def __init__(
        self,
        buffer: LegBuffer,
        rate_hz: float,
        mass_kg: float,
        weight_n: float,
        cutoff_hz: float,
        is_velocity: bool,
    ) -> None:
        self._buffer = buffer
        self._rate_hz = rate_hz
        self._mass_kg = mass_kg
        self._weight_n = weight_n
        self._is_velocity = is_velocity
        self._decimation = max(1, int(rate_hz // DECIMATED_HZ))
        self._even_hz = rate_hz / self._decimation
        self._analyzer = PushOffAnalyzer(self._even_hz, mass_kg, cutoff_hz, is_velocity)
        self._forward_filter = ZeroPhaseFilter(FORWARD_HZ, self._even_hz)
        self._before = int(BEFORE_S * rate_hz)

    def measure(self, contact: Contact, stop: int) -> Stance:
        """Return the stance of a contact that has ended, from the samples before ``stop``."""
        begin, end = contact.begin_index, contact.end_index or 0
        begin_s, end_s = contact.begin_s, contact.end_s or 0.0
        if end - begin > 1.2 * STANCE_MAX_S * self._rate_hz:
            return Stance([RejectionReason.LONG_STANCE], None, None, None)
        reasons = [] if contact.is_onset_seen else [RejectionReason.FORCE_LOST]
        before = self._find_before(begin)
        window = self._buffer.view(begin - before, stop)
        reasons += check_samples(window, before, self._rate_hz, self._mass_kg, self._is_velocity)
        if RejectionReason.TIME_BACKWARDS in reasons:
            return Stance(reasons, None, None, None)
        if end_s - begin_s < STANCE_MIN_S:
            reasons.append(RejectionReason.SHORT_STANCE)
        elif end_s - begin_s > STANCE_MAX_S:
            reasons.append(RejectionReason.LONG_STANCE)
        force = window[FORCE, before : before + end - begin + 1] - contact.offset_n
        reasons += check_force(force, contact.peak_n, self._weight_n, self._rate_hz)
        bridged, gap_s = _bridge_gaps(window, before)
        clean = None if bridged is None else _decimate(bridged[: ANGLE + 1], self._decimation)
        push_off = None
        if clean is not None and clean[TIME, -1] - clean[TIME, 0] < LONGEST_S:
            push_off = self._measure_push_off(contact, clean, gap_s, reasons)
        if push_off is None and not reasons:
            reasons.append(RejectionReason.NO_PUSH_OFF)
        return Stance(
            list(dict.fromkeys(reasons)),
            push_off,
            self._find_propulsion(window),
            self._find_position(contact),
        )

    def locate(self, contact: Contact) -> Stance:
        """Return what is known of the stance of a contact that has not ended: its position."""
        return Stance([], None, None, self._find_position(contact))

    def _measure_push_off(
        self, contact: Contact, clean: Floats, gap_s: float, reasons: list[RejectionReason]
    ) -> PushOff | None:
        """Return the push-off of samples whose gaps are bridged; append what is wrong with it."""
        stance = resample_stance(clean, self._even_hz, contact.begin_s, contact.end_s or 0.0)
        push_off = None if stance is None else self._analyzer.measure(stance)
        if stance is not None and push_off is not None:
            reasons += check_steps(stance, push_off, gap_s, self._is_velocity)
            reasons += check_lever(stance, contact.offset_n, self._weight_n)
            reasons += check_push_off(push_off, stance, self._is_velocity)
        return push_off

    def _find_before(self, begin: int) -> int:
        """Return how many samples before a stance follow each other closely enough to be used."""
        before = min(self._before, begin)
        times = self._buffer.channel(TIME, begin - before, begin + 1)
        steps = times[1:] - times[:-1]
        breaks = np.flatnonzero(~((steps > 0) & (steps <= BEFORE_S)))
        return before - int(breaks[-1]) - 1 if len(breaks) else before

    def _find_propulsion(self, window: Floats) -> float | None:
        forward = window[FORWARD : FORWARD + 1]
        if not math.isfinite(forward[0, -1]) or not np.isfinite(forward).all():
            return None
        decimated = _decimate(forward, self._decimation)
        if decimated is None:
            return None
        smooth = self._forward_filter.smooth(decimated)[0]
        return find_maximum(smooth[len(smooth) // 2 :]) / self._mass_kg

    def _find_position(self, contact: Contact) -> float | None:
        index = contact.begin_index
        (t0, t1), (p0, p1) = self._buffer.view(index - 1, index + 1)[[TIME, POSITION]].tolist()
        share = (contact.begin_s - t0) / (t1 - t0) if t1 > t0 else 1.0
        position = p0 + share * (p1 - p0)
        return position if math.isfinite(position) else None


def _bridge_gaps(window: Floats, stance: int) -> tuple[Floats | None, float]:
    """Return a stance's samples with gaps in moment and angle bridged, and the longest bridge [s].

    The samples are None where nothing is known to bridge between. The time is the longest from
    sample ``stance`` on that a straight line bridges. Longer gaps have made the stride invalid
    already, so that values measured across them are not shown.
    """
    time = window[TIME]
    steps = time[stance + 1 :] - time[stance:-1]
    longest_s = find_maximum(steps)
    if math.isfinite(window[MOMENT : ANGLE + 1].sum()):
        return window, longest_s
    bridged = window.copy()
    for row in bridged[MOMENT : ANGLE + 1]:
        known = np.isfinite(row)
        if known.sum() < 2:
            return None, longest_s
        row[~known] = np.interp(time[~known], time[known], row[known])
        longest_s = max(longest_s, float(np.diff(time[known]).max()))
    return bridged, longest_s


def _decimate(window: Floats, factor: int) -> Floats | None:
    """Return the means of each ``factor`` neighbors, aligned to the end, if there are two."""
    if factor == 1:
        return window
    count = window.shape[1] // factor
    if count < 2:
        return None
    first = window.shape[1] - count * factor
    decimated = window[:, first::factor].copy()
    for neighbor in range(1, factor):
        decimated += window[:, first + neighbor :: factor]
    decimated /= factor
    return decimated
