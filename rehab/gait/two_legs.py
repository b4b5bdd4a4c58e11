"""Strides of both legs, each checked and completed with what the other leg did."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import ArrayLike

from rehab.gait.contacts.contact import Contact
from rehab.gait.contacts.contact_finder import STEP_PEAK
from rehab.gait.detector import Detector
from rehab.gait.one_leg import LegDetector, OneLegStride, OtherLeg
from rehab.gait.signals.filters import find_maximum
from rehab.gait.signals.samples import CHANNEL_NAMES, FORCE, POSITION, LegSamples
from rehab.gait.stances.analysis import Stance
from rehab.gait.stances.limb import find_margin
from rehab.gait.stances.plausibility import (
    check_carried_weight,
    check_whole_foot,
    is_alternating,
    is_weight_supported,
)
from rehab.gait.strides import Flag, RejectionReason, Stride

# What is wrong where both feet are on a plate: then a step is no measure of the other leg's.
UNLIKE_STEPS = {
    RejectionReason.CROSS_STEP,
    RejectionReason.FORCE_LOST,
    RejectionReason.FORCE_TOO_LARGE,
    RejectionReason.MOMENT_OUT_OF_STEP,
    RejectionReason.SHORT_STANCE,
    RejectionReason.WEIGHT,
}
LATEST_S = 2.5  # between two steps that are compared; later, somebody stood between them


@dataclass(frozen=True, slots=True, kw_only=True)
class StepFigures:
    """What a leg's newest stride is compared by with the other leg's: as in ``Stride``."""

    begin_s: float
    step_s: float | None = None
    length_m: float | None = None
    stance_s: float | None = None
    swing_s: float | None = None
    impulse: float | None = None


class TwoLegDetector(Detector):
    """Detects the strides of both legs on a split treadmill, in order of their completion.

    Adds to each stride what takes two legs: step time, length and symmetry, double support, the
    share of body weight on the plates, and whether the feet alternated as in walking. The settings
    are those of ``Detector``.

    Parameters
    ----------
    rate_hz, mass_kg, settings
        As in ``Detector``.
    """

    def __init__(self, rate_hz: float, mass_kg: float, **settings: Any) -> None:
        super().__init__(rate_hz, mass_kg, sides=("left", "right"), **settings)
        self._left, self._right = self._legs
        self._latest: dict[str | None, StepFigures] = {}

    def feed(
        self,
        t_s: ArrayLike,
        left: LegSamples | Sequence[ArrayLike],
        right: LegSamples | Sequence[ArrayLike],
        *,
        frame: ArrayLike | None = None,
    ) -> list[Stride]:
        """Add the next samples of both legs and return the strides that they complete.

        Parameters
        ----------
        t_s
            Times [s] of the sensors' clock, shape (n,).
        left, right
            The channels of each leg, shape (n,) each, as in ``StrideDetector.feed``.
        frame
            As there.

        Raises
        ------
        GaitInputError
            For channels of different lengths.
        """
        if not len(left) == len(right) == len(CHANNEL_NAMES):
            left, right = LegSamples(*left), LegSamples(*right)
        return self._feed((t_s, *left, *right), frame)

    def _detect(self, start: int, stop: int) -> list[Stride]:
        left, right = self._left.advance(start, stop), self._right.advance(start, stop)
        return self._complete(left, right) if left or right else []

    def _complete_last(self) -> list[Stride]:
        return self._complete(self._left.finish(), self._right.finish())

    def _complete(self, left: list[OneLegStride], right: list[OneLegStride]) -> list[Stride]:
        """Return the strides of both legs, in the order in which they were complete."""
        found = [(stride, self._left, self._right) for stride in left]
        found += [(stride, self._right, self._left) for stride in right]
        found.sort(key=lambda one: (one[0].index, one[0].contact.end_index))
        return [
            leg.complete(stride, self._compare_with_other_leg(stride, leg, other))
            for stride, leg, other in found
        ]

    def _is_alone(self, first: Contact | None, this: Contact, second: Contact | None) -> bool:
        """Return whether the other foot is on the floor beside the plates, before or after."""
        if not self._is_overground or (first is not None and second is not None):
            return False
        other = first or second
        return other is None or not (
            other.begin_index >= this.begin_index and other.end <= this.end
        )

    def _compare_with_other_leg(
        self, stride: OneLegStride, leg: LegDetector, other: LegDetector
    ) -> OtherLeg:
        """Return what the other leg did until the sample that completed a stride."""
        this, is_whole = stride.contact, RejectionReason.CUT_OFF not in stride.reasons
        reasons: list[RejectionReason] = []
        flags: list[Flag] = []
        since = max(this.begin_index, stride.index - leg.reliable_samples)
        known = _find_contacts(other, stride.index, since)
        others = [c for c in known if c.begin_index < this.end and c.end > since]
        first = others[0] if others else None
        second = others[1] if len(others) == 2 else None
        if self._is_overground:
            reasons += check_whole_foot(this.peak_n, leg.weight_n)
        if (
            is_whole
            and not self._is_alone(first, this, second)
            and (first is None or second is None or not is_alternating(first, this, second))
        ):
            if RejectionReason.LONG_STANCE not in stride.reasons:
                reasons.append(RejectionReason.CROSS_STEP)
            first = second = None
        if first is not None and first.begin_index >= this.begin_index:  # it stepped here from
            first, second = None, first  # beside the plates
        plates, zeros_n = (leg, other), (this.offset_n, known[-1].offset_n if known else 0.0)
        ratio = carried = _find_weight_ratio(stride.cycle_index, this.begin_index, plates, zeros_n)
        if ratio is None and second is not None:
            # No whole cycle was seen: a step is accurate enough to find a wrong mass.
            carried = _find_weight_ratio(this.begin_index, second.begin_index, plates, zeros_n)
        if not self._is_overground:
            reasons += check_carried_weight(carried)
            if ratio is not None and is_weight_supported(ratio):
                flags.append(Flag.SUPPORTED)
        length = None if first is None else _find_length(stride.stance, other, this.begin_index)
        is_seen = first is not None and first.is_onset_seen
        step = StepFigures(
            begin_s=this.begin_s,
            step_s=_find_time(first.begin_s, this.begin_s) if first and is_seen else None,
            length_m=length,
            stance_s=_find_time(this.begin_s, this.end_s) if is_whole else None,
            swing_s=stride.swing_s,
            impulse=stride.stance.propulsion_impulse_n_s_kg,
        )
        last = self._latest.get(other.side)
        wrong = {*reasons, *stride.reasons}
        # A moment that came late was nobody else's.
        is_own = RejectionReason.LATE in wrong or wrong.isdisjoint(UNLIKE_STEPS)
        self._latest[leg.side] = step if is_own else StepFigures(begin_s=this.begin_s)
        if last is None or not this.begin_s - last.begin_s < LATEST_S:
            last = StepFigures(begin_s=this.begin_s)
        margin_m, foot_m, belt_m_s = None, stride.stance.position_m, stride.stance.belt_m_s
        if first is not None and foot_m is not None and belt_m_s is not None:
            buffers = (leg.buffer, other.buffer)
            margin_m = find_margin(buffers, this.begin_index, foot_m, belt_m_s, leg.rate_hz)
        doubles = (
            _find_time(this.begin_s, first.end_s) if first else None,
            _find_time(second.begin_s, this.end_s) if second else None,
        )
        return OtherLeg(
            reasons=reasons,
            flags=flags,
            step_s=step.step_s,
            step_length_m=length,
            step_symmetry=_find_symmetry(length, last.length_m),
            propulsion_percent=_find_share(step.impulse, last.impulse),
            stance_ratio_percent=_find_ratio(step.stance_s, last.stance_s),
            swing_ratio_percent=_find_ratio(step.swing_s, last.swing_s),
            step_time_ratio_percent=_find_ratio(step.step_s, last.step_s),
            step_length_ratio_percent=_find_ratio(length, last.length_m),
            first_double_support_s=doubles[0],
            second_double_support_s=doubles[1],
            double_support_s=None if None in doubles else math.fsum(filter(None, doubles)),
            walking_ratio_mm_min=_find_walking_ratio(step, last),
            margin_m=margin_m,
            weight_ratio=ratio,
        )


def _find_weight_ratio(
    begin: int | None,
    end: int,
    plates: tuple[LegDetector, LegDetector],
    zeros_n: tuple[float, float],
) -> float | None:
    """Return the mean force of both plates between two samples, by body weight, if it is known."""
    if begin is None:
        return None
    load = sum(
        leg.compute_mean_load(begin, end, zero_n)
        for leg, zero_n in zip(plates, zeros_n, strict=True)
    )
    return load if math.isfinite(load) else None


def _find_contacts(leg: LegDetector, index: int, since: int) -> list[Contact]:
    """Return a leg's contacts as they were known at sample ``index``, whatever came later.

    Of those that ended until sample ``since`` only the last.
    """
    contacts: list[Contact] = []
    for contact in reversed(leg.contacts.recent):
        end = contact.known_index
        if contact.begin_index > index:
            continue
        if end is None or end > index:
            begin = max(contact.begin_index, index - leg.longest_chunk)
            peak_n = find_maximum(leg.buffer.channel(FORCE, begin, index + 1)) - contact.offset_n
            if not peak_n >= STEP_PEAK * leg.weight_n:
                continue
            if end is not None:
                contact = replace(contact, end_index=None, end_s=None, known_index=None)  # noqa: PLW2901
        contacts.append(contact)
        if contact.end <= since:
            break
    return contacts[::-1]


def _find_time(begin_s: float, end_s: float | None) -> float | None:
    """Return the time between two moments [s], if both are known."""
    if end_s is None or not math.isfinite(end_s - begin_s):
        return None
    return end_s - begin_s


def _find_length(stance: Stance, other: LegDetector, index: int) -> float | None:
    """Return how far ahead of the other foot this one landed [m], if positions are known."""
    if stance.position_m is None:
        return None
    position = float(other.buffer.channel(POSITION, index, index + 1)[0])
    length = stance.position_m - position
    return length if math.isfinite(length) else None


def _find_symmetry(this_m: float | None, other_m: float | None) -> float | None:
    if this_m is None or other_m is None or not this_m + other_m > 0:
        return None
    return (this_m - other_m) / (this_m + other_m)


def _find_walking_ratio(this: StepFigures, last: StepFigures) -> float | None:
    """Return step length by cadence [mm per step a minute], of the two last steps."""
    lengths, times = (this.length_m, last.length_m), (this.step_s, last.step_s)
    if None in lengths or None in times:
        return None
    length_m, time_s = (math.fsum(filter(None, two)) / 2 for two in (lengths, times))
    return 1000 * length_m * time_s / 60


def _find_ratio(this: float | None, other: float | None) -> float | None:
    if this is None or other is None or not other > 0:
        return None
    return 100 * this / other


def _find_share(this: float | None, other: float | None) -> float | None:
    if this is None or other is None or not this + other > 0:
        return None
    return 100 * this / (this + other)
