"""One stance: its samples taken from the buffer, checked and measured."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rehab.gait.contacts.contact import Contact
from rehab.gait.signals.buffer import LegBuffer
from rehab.gait.signals.filters import (
    Floats,
    ZeroPhaseFilter,
    find_last,
    find_maximum,
    is_finite,
)
from rehab.gait.signals.samples import ANGLE, FORCE, FORWARD, POSITION, TIME
from rehab.gait.stances.continuity import (
    SPIKES_SHARE,
    check_fills,
    check_samples,
    find_breaks,
    read_moving,
)
from rehab.gait.stances.gaps import HARMFUL_FROM, ClockJudge
from rehab.gait.stances.kinetics import PushOff, PushOffAnalyzer
from rehab.gait.stances.lag_watch import (
    AROUND_S,
    BRAKING_S,
    MOMENT_LAG_S,
    BrakingFinder,
    LagWatch,
    find_moment_lag,
)
from rehab.gait.stances.limb import find_belt_speed, find_trailing_limb
from rehab.gait.stances.plausibility import (
    LEVER_FROM,
    STANCE_MAX_S,
    STANCE_MIN_S,
    check_force,
    check_lever,
    check_push_off,
    has_clonus,
)
from rehab.gait.stances.resampling import (
    ResampledStance,
    Resampler,
    bridge_gaps,
    decimate,
)
from rehab.gait.stances.uncertainty import Uncertainty
from rehab.gait.strides import Flag, RejectionReason

BEFORE_S = 0.25  # of swing: for the filter to settle, and for the check of the moment in swing
LONGEST_S = BEFORE_S + STANCE_MAX_S + 1.0
# Neighbors are averaged down to 200-400 Hz before the filter: signals up to 6 Hz lose nothing.
DECIMATED_HZ = 200.0
FORWARD_HZ = 20.0
LATE_FROM = 0.72  # of stance; there moment and force have their late peaks


@dataclass(slots=True)
class Stance:
    """What was measured of a stance. Without a push-off there is a reason.

    Attributes
    ----------
    reasons
        Why it is invalid.
    push_off
        At its end.
    propulsion_n_kg, propulsion_impulse_n_s_kg, braking_impulse_n_s_kg
        As in ``Stride``.
    position_m
        Of the foot at initial contact [m, forward].
    belt_m_s
        How fast the belt carried the foot back [m/s].
    trailing_limb_deg
        As in ``Stride``.
    flags
        What the therapist should know of it.
    late_s, lost_s, a2_sd_w_kg
        As in ``Stride``.
    """

    reasons: list[RejectionReason]
    push_off: PushOff | None = None
    propulsion_n_kg: float | None = None
    propulsion_impulse_n_s_kg: float | None = None
    braking_impulse_n_s_kg: float | None = None
    position_m: float | None = None
    belt_m_s: float | None = None
    trailing_limb_deg: float | None = None
    flags: tuple[Flag, ...] = ()
    late_s: float = 0.0
    lost_s: float = 0.0
    a2_sd_w_kg: float | None = None


class StanceAnalyzer:
    """Checks and measures the stances of one leg.

    Parameters
    ----------
    buffer, rate_hz
        The samples with their nominal rate.
    mass_kg, weight_n
        Body mass, and weight [N].
    cutoff_hz
        As in ``StrideDetector``.
    """

    def __init__(
        self,
        buffer: LegBuffer,
        rate_hz: float,
        mass_kg: float,
        weight_n: float,
        cutoff_hz: float,
    ) -> None:
        self._buffer = buffer
        self._rate_hz = rate_hz
        self._mass_kg = mass_kg
        self._weight_n = weight_n
        self._decimation = max(1, int(rate_hz // DECIMATED_HZ))
        self._even_hz = rate_hz / self._decimation
        self._analyzer = PushOffAnalyzer(self._even_hz, mass_kg, cutoff_hz)
        self._uncertainty = Uncertainty(self._even_hz, cutoff_hz)
        self._forward_filter = ZeroPhaseFilter(FORWARD_HZ, self._even_hz)
        self._resampler = Resampler(self._even_hz, LONGEST_S)
        self._before = int(BEFORE_S * rate_hz)
        self._clock = ClockJudge(rate_hz)
        self._braking = BrakingFinder()
        self._angle_lag = LagWatch(BRAKING_S)
        self._moment_lag = LagWatch(MOMENT_LAG_S)
        self._last_end: tuple[int, float, float] | None = None

    def measure(self, contact: Contact, stop: int) -> Stance:
        """Return the stance of a contact that has ended, from the samples before ``stop``."""
        begin, end = contact.begin_index, contact.end_index or 0
        begin_s, end_s = contact.begin_s, contact.end_s or 0.0
        if end - begin > 1.2 * STANCE_MAX_S * self._rate_hz:
            return Stance([RejectionReason.LONG_STANCE])
        reasons = [] if contact.is_onset_seen else [RejectionReason.FORCE_LOST]
        samples = self._buffer.samples
        if not samples.goes_on(begin, stop):
            return Stance([*reasons, RejectionReason.TIME_BACKWARDS])
        window, before = self._find_window(begin, stop)
        late_s = samples.find_lateness(begin - before, stop)
        critical_s = begin_s + HARMFUL_FROM * (end_s - begin_s)
        critical = before + max(1, int(window[TIME, before:].searchsorted(critical_s)))
        clock = self._clock.judge(window, late_s, before, critical)
        reasons += clock.reasons
        moving = read_moving(window)
        reasons += check_samples(moving, before, clock, self._rate_hz, self._mass_kg)
        late = moving.steps[:, critical : before + end - begin]
        reasons += check_fills(late, self._rate_hz)
        if end_s - begin_s < STANCE_MIN_S:
            reasons.append(RejectionReason.SHORT_STANCE)
        elif end_s - begin_s > STANCE_MAX_S:
            reasons.append(RejectionReason.LONG_STANCE)
        force = window[FORCE, before : before + end - begin + 1]
        reasons += check_force(
            force, contact.offset_n, contact.peak_n, self._weight_n, self._rate_hz
        )
        is_sure = late_s is None and contact.known_index == end
        self._watch_angle((end, end_s, end_s - begin_s) if is_sure else None, end)
        bridged, gap_s = bridge_gaps(window, clock, moving.is_known)
        clean = None if bridged is None else decimate(bridged, self._decimation)
        push_off, a2_sd, flags = None, None, list(clock.flags)
        if clean is not None and clean.item(TIME, -1) - clean.item(TIME, 0) < LONGEST_S:
            stance = self._resampler.resample(
                clean[: ANGLE + 1], begin_s, end_s, clean[-1] if len(clean) > ANGLE + 1 else None
            )
            push_off = None if stance is None else self._analyzer.measure(stance)
            if stance is not None and push_off is not None:
                by_steps = self._check_push_off(contact, stance, push_off, gap_s, reasons, flags)
                angle = self._angle_lag
                a2_sd = self._uncertainty.find(
                    stance, push_off, clock.late_s, angle.moved_s, angle.beyond_s
                )
                a2_sd = math.hypot(a2_sd, by_steps)
        if push_off is None and not reasons:
            reasons.append(RejectionReason.NO_PUSH_OFF)
        return Stance(
            list(dict.fromkeys(reasons)) if reasons else reasons,
            push_off,
            *self._find_propulsion(window, before, end - begin),
            self._find_position(contact),
            *self._find_posture(begin, end),
            tuple(flags),
            clock.late_s,
            clock.lost_s,
            a2_sd,
        )

    def locate(self, contact: Contact) -> Stance:
        """Return what is known of the stance of a contact that has not ended: its position."""
        return Stance([], position_m=self._find_position(contact))

    def _check_push_off(
        self,
        contact: Contact,
        stance: ResampledStance,
        push_off: PushOff,
        gap_s: float,
        reasons: list[RejectionReason],
        flags: list[Flag],
    ) -> float:
        """Append what a push-off is like; return what spikes and steps make of its A2 [W/kg]."""
        breaks = find_breaks(stance, push_off, gap_s)
        measured = None if breaks.without is stance else self._analyzer.measure(breaks.without)
        other = measured or push_off
        by_steps = abs(push_off.a2_w_kg - other.a2_w_kg)
        reasons += breaks.steps
        if not by_steps <= SPIKES_SHARE * push_off.a2_w_kg:
            reasons += breaks.spikes
        half = stance.index(0.5)
        force_n = stance.signals[0, half : stance.end + 1] - contact.offset_n
        moment_nm = stance.signals[1, half : stance.end + 1]
        toes, late = stance.index(LEVER_FROM) - half, stance.index(LATE_FROM) - half
        reasons += check_lever(force_n, moment_nm, toes, self._weight_n)
        lag_s = find_moment_lag(force_n[late:], moment_nm[late:], self._even_hz)
        # What is refused already, as with the other foot on the plate, tells of no clock.
        self._moment_lag.add(None if reasons else lag_s, stance.end_s - stance.begin_s)
        if self._moment_lag.beyond_s or self._moment_lag.has_drifted:
            reasons.append(RejectionReason.MOMENT_OUT_OF_STEP)
        if self._angle_lag.has_drifted:
            reasons.append(RejectionReason.ANGLE_OUT_OF_STEP)
        if self._angle_lag.beyond_s:
            flags.append(Flag.UNUSUAL_TIMING)
        reasons += check_push_off(push_off, stance)
        if has_clonus(push_off, stance):
            flags.append(Flag.CLONUS)
        return by_steps

    def _watch_angle(self, sure: tuple[int, float, float] | None, end: int) -> None:
        """Add when the ankle braked after the stance before, if it is sure when that ended.

        At its own end that was not known yet. ``sure`` is its sample, time and length.
        """
        last, self._last_end = self._last_end, sure
        if last is None:
            return
        around = int((AROUND_S + 0.1) * self._rate_hz)
        first, stop = last[0] - around, min(last[0] + around, end)
        buffer = self._buffer
        if first >= buffer.samples.first and buffer.samples.goes_on(first, stop):
            time, angle = buffer.channel(TIME, first, stop), buffer.channel(ANGLE, first, stop)
            self._angle_lag.add(self._braking.find(time, angle, last[1]), last[2])

    def _find_window(self, begin: int, stop: int) -> tuple[Floats, int]:
        """Return the samples from swing to ``stop``, and how many come before the stance.

        Before the stance come as many as follow each other closely enough to be used.
        """
        before = min(self._before, begin)
        window = self._buffer.view(begin - before, stop)
        if not self._buffer.samples.goes_on(begin - before, begin + 1, BEFORE_S):
            swing_s = np.diff(window[TIME, : before + 1])
            cut = find_last(~((swing_s > 0) & (swing_s <= BEFORE_S))) + 1
            window, before = window[:, cut:], before - cut
        return window, before

    def _find_propulsion(
        self, window: Floats, before: int, count: int
    ) -> tuple[float | None, float | None, float | None]:
        """Return the largest forward force, and the impulses that drive and brake, by body mass.

        The stance is ``count`` samples of the window, after ``before`` of swing.
        """
        if not math.isfinite(window.item(FORWARD, -1)) or not is_finite(window[FORWARD]):
            return None, None, None
        forward = window[FORWARD : FORWARD + 1]
        decimated = decimate(forward, self._decimation)
        if decimated is None:
            return None, None, None
        smooth = self._forward_filter.smooth(decimated)[0] / self._mass_kg
        peak = find_maximum(smooth[len(smooth) // 2 :])
        after = window.shape[1] - before - count  # decimated samples are aligned to the end
        stop = len(smooth) - after // self._decimation
        stance = smooth[max(0, stop - count // self._decimation) : stop]
        driving = float(np.maximum(stance, 0.0).sum()) / self._even_hz
        return peak, driving, driving - float(stance.sum()) / self._even_hz

    def _find_posture(self, begin: int, end: int) -> tuple[float | None, float | None]:
        """Return the belt's speed and the trailing limb angle, where positions are known."""
        if not math.isfinite(self._buffer.channel(POSITION, end - 1, end).item()):
            return None, None
        belt_m_s = find_belt_speed(self._buffer, begin, end)
        return belt_m_s, find_trailing_limb(self._buffer, begin, end, self._rate_hz)

    def _find_position(self, contact: Contact) -> float | None:
        index = contact.begin_index
        p0, p1 = self._buffer.channel(POSITION, index - 1, index + 1).tolist()
        if not math.isfinite(p1 - p0):
            return None
        t0, t1 = self._buffer.channel(TIME, index - 1, index + 1).tolist()
        share = (contact.begin_s - t0) / (t1 - t0) if t1 > t0 else 1.0
        position = p0 + share * (p1 - p0)
        return position if math.isfinite(position) else None
