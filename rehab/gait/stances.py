"""One stance: its samples taken from the buffer, checked and measured."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rehab.gait.contacts import Contact
from rehab.gait.filters import Floats, ZeroPhaseFilter
from rehab.gait.kinetics import PushOff, PushOffMeter
from rehab.gait.plausibility import (
    STANCE_MAX_S,
    STANCE_MIN_S,
    check_force,
    check_lever,
    check_push_off,
    check_samples,
)
from rehab.gait.samples import ANGLE, FORCE, FORWARD, MOMENT, POSITION, TIME, SampleBuffer
from rehab.gait.strides import Reason

BEFORE_S = 0.25  # of swing that the filter gets to settle, and that the moment is looked at in
LONGEST_S = BEFORE_S + STANCE_MAX_S + 1.0
THIN_HZ = 200.0  # neighbors are averaged down to 200-400 Hz before the filter: 6 Hz lose nothing
FORWARD_HZ = 20.0


@dataclass(frozen=True, slots=True)
class Stance:
    """What a stance gave. Without a push-off there is a reason."""

    reasons: list[Reason]
    push_off: PushOff | None
    propulsion_n_kg: float | None
    position_m: float | None


class StanceMeter:
    """Checks and measures the stances of one leg.

    Parameters
    ----------
    buffer, rate_hz, mass_kg, weight_n
        Samples with their nominal rate, and the walker.
    cutoff_hz, is_velocity
        As in ``StrideDetector``.
    """

    def __init__(
        self,
        buffer: SampleBuffer,
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
        self._thin = max(1, int(rate_hz // THIN_HZ))
        self._meter = PushOffMeter(rate_hz / self._thin, mass_kg, cutoff_hz, is_velocity)
        self._forward_filter = ZeroPhaseFilter(FORWARD_HZ, rate_hz / self._thin)
        self._before = int(BEFORE_S * rate_hz)

    def measure(self, contact: Contact, stop: int) -> Stance:
        """Measure the stance of a contact that has ended, from the samples before ``stop``."""
        begin, end = contact.begin_index, contact.end_index or 0
        begin_s, end_s = contact.begin_s, contact.end_s or 0.0
        if end - begin > 1.2 * STANCE_MAX_S * self._rate_hz:
            return Stance([Reason.LONG_STANCE], None, None, None)
        reasons = [] if contact.seen else [Reason.FORCE_LOST]
        before = self._find_before(begin)
        window = self._buffer.view(begin - before, stop)
        reasons += check_samples(window, before, self._rate_hz, self._mass_kg, self._is_velocity)
        if Reason.TIME_BACKWARDS in reasons:
            return Stance(reasons, None, None, None)
        if end_s - begin_s < STANCE_MIN_S:
            reasons.append(Reason.SHORT_STANCE)
        elif end_s - begin_s > STANCE_MAX_S:
            reasons.append(Reason.LONG_STANCE)
        force = window[FORCE, before : before + end - begin + 1] - contact.offset_n
        for reason in check_force(force, contact.peak_n, self._weight_n, self._rate_hz):
            if reason not in reasons:
                reasons.append(reason)
        clean = _thin_out(_mend(window), self._thin)
        push_off = None
        if clean is not None and clean[TIME, -1] - clean[TIME, 0] < LONGEST_S:
            push_off = self._meter.measure(clean[TIME], clean[MOMENT], clean[ANGLE], begin_s, end_s)
        if push_off is not None and clean is not None:
            force = clean[FORCE] - contact.offset_n
            reasons += check_lever(
                clean[TIME], force, clean[MOMENT], begin_s, end_s, self._weight_n
            )
            reasons += check_push_off(push_off, begin_s, end_s, self._is_velocity)
        elif not reasons:
            reasons.append(Reason.NO_PUSH_OFF)
        return Stance(reasons, push_off, self._find_propulsion(clean), self._find_position(contact))

    def _find_before(self, begin: int) -> int:
        """Give how many samples before a stance follow each other well enough to use them."""
        before = min(self._before, begin)
        times = self._buffer.channel(TIME, begin - before, begin + 1)
        steps = times[1:] - times[:-1]
        breaks = np.flatnonzero(~((steps > 0) & (steps <= BEFORE_S)))
        return before - int(breaks[-1]) - 1 if len(breaks) else before

    def _find_propulsion(self, window: Floats | None) -> float | None:
        if window is None or not np.isfinite(window[FORWARD]).all():
            return None
        smooth = self._forward_filter.smooth(window[FORWARD : FORWARD + 1])[0]
        return float(smooth[len(smooth) // 2 :].max()) / self._mass_kg

    def _find_position(self, contact: Contact) -> float | None:
        index = contact.begin_index
        (t0, t1), (p0, p1) = self._buffer.view(index - 1, index + 1)[[TIME, POSITION]].tolist()
        share = (contact.begin_s - t0) / (t1 - t0) if t1 > t0 else 1.0
        position = p0 + share * (p1 - p0)
        return position if math.isfinite(position) else None


def _mend(window: Floats) -> Floats | None:
    """Give a stance's samples with holes in moment and angle bridged; None where there is nothing.

    Holes too long for it have their reason already; nobody is shown what is measured across them.
    """
    signals = window[MOMENT : ANGLE + 1]
    if np.isfinite(signals.sum()):
        return window
    mended = window.copy()
    for row in mended[MOMENT : ANGLE + 1]:
        known = np.isfinite(row)
        if known.sum() < 2:
            return None
        row[~known] = np.interp(window[TIME][~known], window[TIME][known], row[known])
    return mended


def _thin_out(window: Floats | None, factor: int) -> Floats | None:
    """Average each ``factor`` neighbors, aligned to the end."""
    if window is None or factor == 1:
        return window
    count = window.shape[1] // factor
    if count < 2:
        return None
    first = window.shape[1] - count * factor
    thin = window[:, first::factor].copy()
    for neighbor in range(1, factor):
        thin += window[:, first + neighbor :: factor]
    thin /= factor
    return thin
