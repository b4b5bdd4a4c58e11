"""Strides of one leg, detected and measured as they end, in a buffer that others fill."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from rehab.gait.contacts.contact import Contact
from rehab.gait.contacts.contact_finder import ContactFinder
from rehab.gait.settings import DetectorSettings
from rehab.gait.signals.buffer import LegBuffer
from rehab.gait.signals.samples import FORCE
from rehab.gait.stances.analysis import Stance, StanceAnalyzer
from rehab.gait.stances.limb import find_knee_flexion
from rehab.gait.stances.plausibility import FULL_LOAD, STANCE_MAX_S, STANCE_MIN_S
from rehab.gait.strides import Flag, RejectionReason, Stride, read_figures

GRAVITY_M_S2 = 9.81
KEEP_S = 12.0  # the longest cycle, the longest stance after it, and the piece that they end in
LONGEST_CHUNK_S = 1.0  # longer chunks are processed in pieces of this length
STRIDE_MAX_S = 6.0
LONGEST_GAP_S = 0.25  # in a cycle; longer ones may hide a contact
OFFSET_N = 15.0
USUAL_STANCES = 9
USUAL_MIN, USUAL_MAX = 0.6, 1.5  # of the median of the last stances


@dataclass(slots=True)
class OtherLeg:
    """What the other leg and its plate add to a stride.

    Attributes
    ----------
    reasons, flags
        Why the stride is invalid, and what the therapist should know of it.
    step_s … weight_ratio
        As in ``Stride``.
    """

    reasons: list[RejectionReason]
    flags: list[Flag]
    step_s: float | None = None
    step_length_m: float | None = None
    step_symmetry: float | None = None
    propulsion_percent: float | None = None
    stance_ratio_percent: float | None = None
    swing_ratio_percent: float | None = None
    step_time_ratio_percent: float | None = None
    step_length_ratio_percent: float | None = None
    first_double_support_s: float | None = None
    second_double_support_s: float | None = None
    double_support_s: float | None = None
    walking_ratio_mm_min: float | None = None
    margin_m: float | None = None
    weight_ratio: float | None = None


@dataclass(slots=True)
class OneLegStride:
    """A stride as measured on its own leg, before the other leg is considered.

    Attributes
    ----------
    index
        The sample that completed it.
    contact, stance
        Its contact with the plate, and what was measured of the stance.
    reasons
        Those of its own leg.
    cycle_index
        Where the cycle before it began; None where that was not observed whole.
    stride_s, swing_s
        Of that cycle [s].
    knee_flexion_deg
        As in ``Stride``.
    """

    index: int
    contact: Contact
    stance: Stance
    reasons: list[RejectionReason]
    cycle_index: int | None
    stride_s: float | None
    swing_s: float | None
    knee_flexion_deg: float | None = None


class LegDetector:
    """Detects and measures the strides of one leg in a buffer that others fill.

    Parameters
    ----------
    buffer
        The leg's samples.
    settings
        How they are measured.
    side
        Which leg it is, if that is known.
    """

    def __init__(self, buffer: LegBuffer, settings: DetectorSettings, side: str | None) -> None:
        rate_hz = self.rate_hz = settings.rate_hz
        self.buffer = buffer
        self.mass_kg = float(settings.mass_kg)
        self.weight_n = self.mass_kg * GRAVITY_M_S2
        self.side = side
        self.contacts = ContactFinder(
            buffer, rate_hz, self.weight_n, settings.contact_n, settings.release_n
        )
        self._samples = buffer.samples
        self.longest_chunk = int(LONGEST_CHUNK_S * rate_hz)
        # So many of the newest samples are still buffered when a stride is completed.
        self.reliable_samples = self._samples.keep - 2 * self.longest_chunk
        self._cycle_max = STRIDE_MAX_S * rate_hz
        self._analyzer = StanceAnalyzer(
            buffer,
            float(rate_hz),
            self.mass_kg,
            self.weight_n,
            settings.cutoff_hz,
        )
        self._wait = math.ceil(settings.look_ahead_s * rate_hz - 1e-9)
        self.pending: deque[Contact] = deque()
        self._previous: Contact | None = None  # the stance before, with its bounces
        self._last_terminal: tuple[int, float] | None = None  # where it really ended
        self._stances: deque[float] = deque(maxlen=USUAL_STANCES)
        self._number = 0

    def advance(self, start: int, stop: int) -> list[OneLegStride]:
        """Process the next samples, and return the strides that they complete.

        Parameters
        ----------
        start, stop
            Indices of the first sample and of the one behind the last, at most ``longest_chunk``
            apart.
        """
        self.pending.extend(self.contacts.advance(start, stop))
        strides: list[OneLegStride] = []
        while self.pending:
            ended = self.pending[0]
            due = max((ended.end_index or 0) + self._wait, ended.known_index or 0)
            if due >= stop:
                break
            contact = self.pending.popleft()
            if self._is_measurable(contact):
                strides.append(self._measure(contact, due))
        return strides

    def finish(self) -> list[OneLegStride]:
        """Return the strides that still wait, and the one that the record's end cuts off."""
        last = self._samples.end - 1
        strides = [self._measure(one, last) for one in self.pending if self._is_measurable(one)]
        self.pending.clear()
        current = self.contacts.truncate()
        if current is not None and (current.end_s or 0.0) - current.begin_s <= STANCE_MAX_S:
            cycle = self._find_cycle(current)
            stance = self._analyzer.locate(current)
            strides.append(OneLegStride(last, current, stance, [RejectionReason.CUT_OFF], *cycle))
        return strides

    def complete(self, stride: OneLegStride, other_leg: OtherLeg) -> Stride:
        """Return the whole stride, from its own leg's part and the other leg's.

        Parameters
        ----------
        stride
            What was measured on its own leg.
        other_leg
            What the other leg adds: reasons, flags and the figures that take two legs.
        """
        contact, stance = stride.contact, stride.stance
        reasons = stride.reasons + other_leg.reasons
        flags = [*stance.flags, *other_leg.flags]
        if abs(contact.offset_n) > OFFSET_N:
            flags = [Flag.OFFSET, *flags]
        # A leg that never bears the whole weight is supported.
        if contact.peak_n < FULL_LOAD * self.weight_n and Flag.SUPPORTED not in flags:
            flags = [*flags, Flag.SUPPORTED]
        begin_s, end_s = contact.begin_s, contact.end_s or 0.0
        self._number += 1
        return Stride(
            number=self._number,
            initial_contact_s=begin_s,
            terminal_contact_s=end_s,
            valid=not reasons,
            reasons=tuple(reasons),
            flags=tuple(flags),
            stance_s=end_s - begin_s,
            force_peak_n_kg=contact.peak_n / self.mass_kg,
            side=self.side,
            **read_figures(contact, stance, stance.push_off, stride, other_leg),
        )

    def compute_mean_load(self, begin: int, end: int, offset_n: float) -> float:
        """Return the mean force above the plate's zero between two samples, by body weight.

        Parameters
        ----------
        begin, end
            Indices of the first sample and of the one behind the last.
        offset_n
            The plate's zero [N].

        Returns
        -------
        NaN where samples have no force, are no longer buffered or are more than a cycle's.
        """
        if begin < self._samples.first or not 0 < end - begin <= self._cycle_max:
            return math.nan
        force = self.buffer.channel(FORCE, begin, end)
        return (float(np.add.reduce(force)) / (end - begin) - offset_n) / self.weight_n

    def _is_measurable(self, contact: Contact) -> bool:
        """Return whether a contact is a stance to be measured; store where it ended if not."""
        is_cut = contact.begin_index == 0  # the record began in the middle of it
        if is_cut or contact.is_bounce:
            self._previous = None if is_cut else self._previous
            self._last_terminal = (contact.end_index or 0, contact.end_s or 0.0)
        return not is_cut and not contact.is_bounce

    def _measure(self, contact: Contact, due: int) -> OneLegStride:
        """Measure a stance that sample ``due`` completes."""
        end_s = contact.end_s or 0.0
        stance = self._analyzer.measure(contact, due + 1)
        cycle = self._find_cycle(contact)
        swing = self._last_terminal if cycle[0] is not None else None
        reasons = stance.reasons
        if self._is_unusual(end_s - contact.begin_s):
            reasons = [*reasons, RejectionReason.IRREGULAR]
        self._previous, self._last_terminal = contact, (contact.end_index or 0, end_s)
        flexion_deg = swing and find_knee_flexion(
            self.buffer, swing[0], contact.begin_index, self.rate_hz
        )
        return OneLegStride(due, contact, stance, reasons, *cycle, flexion_deg)

    def _find_cycle(self, contact: Contact) -> tuple[int | None, float | None, float | None]:
        """Return begin, stride and swing time of the cycle before a contact, if observed whole."""
        if self._previous is None or self._last_terminal is None or not contact.is_onset_seen:
            return None, None, None
        left_index, left_s = self._last_terminal
        begin = self._previous.begin_index
        stride_s = contact.begin_s - self._previous.begin_s
        if contact.begin_index - begin > self._cycle_max or stride_s > STRIDE_MAX_S:
            return None, None, None
        if left_index - 1 < self._samples.first:
            return None, None, None
        stop = contact.begin_index + 1
        if not (stride_s > 0 and self._samples.goes_on(left_index - 1, stop, LONGEST_GAP_S)):
            return None, None, None
        return begin, stride_s, contact.begin_s - left_s

    def _is_unusual(self, stance_s: float) -> bool:
        """Return whether a stance time is far from the last ones, valid or not; then store it."""
        usual = sorted(self._stances)[len(self._stances) // 2] if len(self._stances) > 1 else None
        if STANCE_MIN_S <= stance_s <= STANCE_MAX_S:
            self._stances.append(stance_s)
        return usual is not None and not USUAL_MIN < stance_s / usual < USUAL_MAX
