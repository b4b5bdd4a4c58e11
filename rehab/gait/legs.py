"""Strides of both legs, each looked at beside the other one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from numpy.typing import ArrayLike

from rehab.gait.contacts import CONTACT_N, RELEASE_N, STEP_PEAK, Contact
from rehab.gait.kinetics import CUTOFF_HZ
from rehab.gait.online import STRIDE_MAX_S, StrideDetector
from rehab.gait.samples import FORCE, POSITION, read_chunk
from rehab.gait.strides import Flag, Reason, Stride

# Mean force of both plates over a cycle, by body weight (gait.md 2.3): a handrail takes some of it,
# a harness up to half; nothing adds any, so that more tells of a wrong mass, unit or plate.
SUPPORTED_BELOW = 0.95
WEIGHT_MIN, WEIGHT_MAX = 0.5, 1.1
ALONE_MAX = 0.8  # of stance; 0.5-0.72 from slow to fast walking, 1 at its change to running


class LegSamples(NamedTuple):
    """One leg's channels of a chunk, as ``StrideDetector.feed`` takes them."""

    force_n: ArrayLike
    moment_nm: ArrayLike
    angle_rad: ArrayLike
    forward_n: ArrayLike | None = None
    position_m: ArrayLike | None = None


class TwoLegDetector:
    """Finds the strides of both legs on a split treadmill, in the order in which they are known.

    Adds to each stride what takes two: step time, length and symmetry, double support, the share of
    body weight on the plates, and whether both feet were where a walker has them. Chunks, memory
    and settings are as in ``StrideDetector``.
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
        self.left, self.right = (
            StrideDetector(
                rate_hz,
                mass_kg,
                look_ahead_s=look_ahead_s,
                cutoff_hz=cutoff_hz,
                contact_n=contact_n,
                release_n=release_n,
                is_velocity=is_velocity,
                side=side,
            )
            for side in ("left", "right")
        )
        self._steps_m: dict[str | None, float | None] = {}

    def feed(
        self,
        t_s: ArrayLike,
        left: LegSamples | Sequence[ArrayLike],
        right: LegSamples | Sequence[ArrayLike],
    ) -> list[Stride]:
        """Take the next samples of both legs; give the strides that they complete.

        Raises
        ------
        GaitInputError
            For channels of different lengths.
        """
        both = [(self.left, read_chunk(t_s, *left)), (self.right, read_chunk(t_s, *right))]
        time = both[0][1][0]
        length = 0 if time is None else len(time)
        strides: list[Stride] = []
        for start in range(0, length, self.left.piece):
            stop = min(length, start + self.left.piece)
            found = [found for leg, chunk in both for found in leg.take(chunk, start, stop)]
            if found:
                found.sort(key=lambda one: one[0])
                strides += [self._compare(*one) for one in found]
        return strides

    def finish(self) -> list[Stride]:
        """Give the strides that still wait for samples after their terminal contact."""
        end = self.left.buffer.end
        found = [*self.left.take_rest(), *self.right.take_rest()]
        found.sort(key=lambda one: one[0].terminal_contact_s)
        return [self._compare(end - 1, stride, contact) for stride, contact in found]

    def _compare(self, index: int, stride: Stride, this: Contact) -> Stride:
        """Complete a stride by what the other leg did until sample ``index``."""
        leg, other = (self.left, self.right) if stride.side == "left" else (self.right, self.left)
        own = _find_contacts(leg, index)
        others = [
            c
            for c in _find_contacts(other, index)
            if c.begin_index < _end(this) and _end(c) > this.begin_index
        ]
        reasons, flags = list(stride.reasons), list(stride.flags)
        first, second = (others[0], others[1]) if len(others) == 2 else (None, None)
        if first is None or second is None or not _is_walked(first, this, second):
            if Reason.LONG_STANCE not in reasons:
                reasons.append(Reason.CROSS_STEP)
            first = second = None
        ratio = self._weigh(own, this, other, index)
        if ratio is None and second is not None:
            # No whole cycle was seen: a step comes near enough to tell a wrong mass.
            begin, end = this.begin_index, second.begin_index
            carried = self._find_load(begin, end, this.offset_n + second.offset_n)
        else:
            carried = ratio
        if carried is not None and not WEIGHT_MIN <= carried <= WEIGHT_MAX:
            reasons.append(Reason.WEIGHT)
        elif ratio is not None and ratio < SUPPORTED_BELOW and Flag.SUPPORTED not in flags:
            flags.append(Flag.SUPPORTED)
        step_s = first_s = second_s = length = None
        if first is not None and second is not None:
            step_s = _find_time(first.begin_s if first.seen else None, this.begin_s)
            first_s = _find_time(this.begin_s, first.end_s)
            second_s = _find_time(second.begin_s, this.end_s)
            length = _find_length(stride, other, this.begin_index)
        symmetry = _find_symmetry(length, self._steps_m.get(other.side))
        self._steps_m[stride.side] = length
        return replace(
            stride,
            valid=not reasons,
            reasons=tuple(reasons),
            flags=tuple(flags),
            step_s=step_s,
            step_length_m=length,
            step_symmetry=symmetry,
            first_double_support_s=first_s,
            second_double_support_s=second_s,
            weight_ratio=ratio,
        )

    def _weigh(
        self, own: list[Contact], this: Contact, other: StrideDetector, index: int
    ) -> float | None:
        """Give the mean force of both plates over the cycle before a contact, by body weight."""
        before = [c for c in own if c.end_index is not None and c.end_index < this.begin_index]
        before = [c for c in before if not c.bounce]
        if not before:
            return None
        begin, end = before[-1].begin_index, this.begin_index
        if begin == 0:
            return None
        known = _find_contacts(other, index)
        offset = known[-1].offset_n if known else 0.0
        return self._find_load(begin, end, this.offset_n + offset)

    def _find_load(self, begin: int, end: int, offset_n: float) -> float | None:
        """Give the mean force of both plates between two samples, by body weight."""
        if end - begin > STRIDE_MAX_S * self.left.rate_hz:
            return None
        left, right = (leg.buffer.channel(FORCE, begin, end) for leg in (self.left, self.right))
        load = float((left.sum() + right.sum()) / (end - begin)) - offset_n
        return load / self.left.weight_n if math.isfinite(load) else None


def _is_walked(first: Contact, this: Contact, second: Contact) -> bool:
    """Say whether the other foot left after this one came and came before it left, as in walking.

    A foot that stands alone for longer than a walker's has another one on its plate.
    """
    alone = second.begin_index - _end(first)
    stance = _end(this) - this.begin_index
    return first.begin_index < this.begin_index and 0 < alone < ALONE_MAX * stance


def _end(contact: Contact) -> float:
    return math.inf if contact.end_index is None else contact.end_index


def _find_contacts(leg: StrideDetector, index: int) -> list[Contact]:
    """Give a leg's contacts as they were known at sample ``index``, whatever came later."""
    contacts = []
    for contact in leg.contacts.recent:
        end = contact.end_index
        if contact.begin_index > index:
            break
        if end is None or end > index:
            begin = max(contact.begin_index, index - leg.piece)
            peak_n = leg.buffer.channel(FORCE, begin, index + 1).max() - contact.offset_n
            if not peak_n >= STEP_PEAK * leg.weight_n:
                continue
            if end is not None:
                contact = replace(contact, end_index=None, end_s=None)  # noqa: PLW2901
        contacts.append(contact)
    return contacts


def _find_time(begin_s: float | None, end_s: float | None) -> float | None:
    """Give the time between two moments, if both are known."""
    if begin_s is None or end_s is None or not math.isfinite(end_s - begin_s):
        return None
    return end_s - begin_s


def _find_length(stride: Stride, other: StrideDetector, index: int) -> float | None:
    """Give how far the foot landed ahead of the other one."""
    if stride.position_m is None:
        return None
    position = float(other.buffer.channel(POSITION, index, index + 1)[0])
    length = stride.position_m - position
    return length if math.isfinite(length) else None


def _find_symmetry(this_m: float | None, other_m: float | None) -> float | None:
    if this_m is None or other_m is None or not this_m + other_m > 0:
        return None
    return (this_m - other_m) / (this_m + other_m)
