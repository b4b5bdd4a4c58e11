"""Strides of both legs, each checked and completed with what the other leg did."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from numpy.typing import ArrayLike

from rehab.gait.contacts.force_plate import CONTACT_N, RELEASE_N, STEP_PEAK, Contact
from rehab.gait.one_leg import KEEP_S, LegDetector, OneLegStride, OtherLeg
from rehab.gait.settings import DetectorSettings
from rehab.gait.signals.buffer import SampleBuffer
from rehab.gait.signals.filters import find_maximum
from rehab.gait.signals.samples import (
    CHANNEL_NAMES,
    FORCE,
    POSITION,
    LegSamples,
    read_chunk,
    split_chunk,
)
from rehab.gait.stances.analysis import Stance
from rehab.gait.stances.kinetics import CUTOFF_HZ
from rehab.gait.strides import Flag, RejectionReason, Stride

CHUNK_NAMES = ("t_s", *(f"{side} {name}" for side in ("left", "right") for name in CHANNEL_NAMES))

# Mean force of both plates over a cycle, by body weight (docs/reference/gait.md#bad-signals): a
# handrail takes some of it, a harness up to half; nothing adds any, so that more means a wrong
# mass, unit or plate.
SUPPORTED_BELOW = 0.95
WEIGHT_MIN, WEIGHT_MAX = 0.5, 1.1
ALONE_MAX = 0.8  # of stance; 0.5-0.72 from slow to fast walking, 1 at its change to running


class TwoLegDetector:
    """Detects the strides of both legs on a split treadmill, in order of their completion.

    Adds to each stride what takes two legs: step time, length and symmetry, double support, the
    share of body weight on the plates, and whether the feet alternated as in walking.

    Parameters
    ----------
    rate_hz, mass_kg, look_ahead_s, cutoff_hz, contact_n, release_n, is_velocity
        As in ``StrideDetector``; chunks and memory, too.

    Raises
    ------
    GaitInputError
        For settings that nothing can be measured with.
    """

    def __init__(
        self,
        rate_hz: float,
        mass_kg: float,
        *,
        look_ahead_s: float = 0.0,
        cutoff_hz: float = CUTOFF_HZ,
        contact_n: float = CONTACT_N,
        release_n: float = RELEASE_N,
        is_velocity: bool = False,
    ) -> None:
        settings = DetectorSettings(
            rate_hz=rate_hz,
            mass_kg=mass_kg,
            look_ahead_s=look_ahead_s,
            cutoff_hz=cutoff_hz,
            contact_n=contact_n,
            release_n=release_n,
            is_velocity=is_velocity,
        )
        self._samples = SampleBuffer(int(KEEP_S * rate_hz), legs=2)
        self._left, self._right = (
            LegDetector(buffer, settings, side)
            for buffer, side in zip(self._samples.legs, ("left", "right"), strict=True)
        )
        self._steps_m: dict[str | None, float | None] = {}

    def feed(
        self,
        t_s: ArrayLike,
        left: LegSamples | Sequence[ArrayLike],
        right: LegSamples | Sequence[ArrayLike],
    ) -> list[Stride]:
        """Add the next samples of both legs and return the strides that they complete.

        Parameters
        ----------
        t_s
            Times [s] of the sensors' clock, shape (n,).
        left, right
            The channels of each leg, shape (n,) each, as in ``StrideDetector.feed``.

        Raises
        ------
        GaitInputError
            For channels of different lengths.
        """
        chunk = read_chunk(CHUNK_NAMES, (t_s, *_pad_channels(left), *_pad_channels(right)))
        strides: list[Stride] = []
        for piece, count in split_chunk(chunk, self._left.longest_chunk):
            first = self._samples.end
            self._samples.append(piece, count)
            stop = self._samples.end
            left_found = self._left.advance(first, stop)
            right_found = self._right.advance(first, stop)
            if left_found or right_found:
                strides += self._complete(left_found, right_found)
        return strides

    def finish(self) -> list[Stride]:
        """Return the strides that still wait for samples.

        Stances that the end of the samples cuts off are among them, invalid.
        """
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

    def _compare_with_other_leg(
        self, stride: OneLegStride, leg: LegDetector, other: LegDetector
    ) -> OtherLeg:
        """Return what the other leg did until the sample that completed a stride."""
        this, is_whole = stride.contact, RejectionReason.CUT_OFF not in stride.reasons
        reasons: list[RejectionReason] = []
        flags: list[Flag] = []
        known = _find_contacts(other, stride.index)
        since = max(this.begin_index, stride.index - leg.reliable_samples)
        others = [c for c in known if c.begin_index < _end(this) and _end(c) > since]
        first = others[0] if others else None
        second = others[1] if len(others) == 2 else None
        if is_whole and (
            first is None or second is None or not _is_alternating(first, this, second)
        ):
            if RejectionReason.LONG_STANCE not in stride.reasons:
                reasons.append(RejectionReason.CROSS_STEP)
            first = second = None
        plates, zeros_n = (leg, other), (this.offset_n, known[-1].offset_n if known else 0.0)
        ratio = carried = _find_weight_ratio(stride.cycle_index, this.begin_index, plates, zeros_n)
        if ratio is None and second is not None:
            # No whole cycle was seen: a step is accurate enough to find a wrong mass.
            carried = _find_weight_ratio(this.begin_index, second.begin_index, plates, zeros_n)
        if carried is not None and not WEIGHT_MIN <= carried <= WEIGHT_MAX:
            reasons.append(RejectionReason.WEIGHT)
        elif ratio is not None and ratio < SUPPORTED_BELOW:
            flags.append(Flag.SUPPORTED)
        length = None if first is None else _find_length(stride.stance, other, this.begin_index)
        symmetry = _find_symmetry(length, self._steps_m.get(other.side))
        self._steps_m[leg.side] = length
        return OtherLeg(
            reasons=reasons,
            flags=flags,
            step_s=_find_time(first.begin_s, this.begin_s)
            if first and first.is_onset_seen
            else None,
            step_length_m=length,
            step_symmetry=symmetry,
            first_double_support_s=_find_time(this.begin_s, first.end_s) if first else None,
            second_double_support_s=_find_time(second.begin_s, this.end_s) if second else None,
            weight_ratio=ratio,
        )


def _pad_channels(leg: LegSamples | Sequence[ArrayLike]) -> Sequence[ArrayLike | None]:
    return leg if len(leg) == len(CHANNEL_NAMES) else LegSamples(*leg)


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


def _is_alternating(first: Contact, this: Contact, second: Contact) -> bool:
    """Return whether the other foot left after this one came, and came before it left.

    A foot that is alone on the floor for longer than in walking has the other one on its plate.
    """
    alone = second.begin_index - _end(first)
    stance = _end(this) - this.begin_index
    return first.begin_index < this.begin_index and 0 < alone < ALONE_MAX * stance


def _end(contact: Contact) -> float:
    return math.inf if contact.end_index is None else contact.end_index


def _find_contacts(leg: LegDetector, index: int) -> list[Contact]:
    """Return a leg's contacts as they were known at sample ``index``, whatever came later."""
    contacts = []
    for contact in leg.contacts.recent:
        end = contact.end_index
        if contact.begin_index > index:
            break
        if end is None or end > index:
            begin = max(contact.begin_index, index - leg.longest_chunk)
            peak_n = find_maximum(leg.buffer.channel(FORCE, begin, index + 1)) - contact.offset_n
            if not peak_n >= STEP_PEAK * leg.weight_n:
                continue
            if end is not None:
                contact = replace(contact, end_index=None, end_s=None)  # noqa: PLW2901
        contacts.append(contact)
    return contacts


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
