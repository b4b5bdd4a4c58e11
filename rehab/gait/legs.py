"""Strides of both legs, each looked at beside the other one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from numpy.typing import ArrayLike

from rehab.gait.contacts import CONTACT_N, RELEASE_N, STEP_PEAK, Contact
from rehab.gait.detector import KEEP_S, Beside, Draft, LegDetector
from rehab.gait.filters import find_highest
from rehab.gait.kinetics import CUTOFF_HZ
from rehab.gait.samples import FORCE, NAMES, POSITION, SampleBuffer, cut, read_chunk
from rehab.gait.settings import Settings
from rehab.gait.stances import Stance
from rehab.gait.strides import Flag, Reason, Stride

CHANNELS = ("t_s", *(f"{side} {name}" for side in ("left", "right") for name in NAMES))

# Mean force of both plates over a cycle, by body weight (docs/reference/gait.md#bad-signals): a
# handrail takes some of it, a harness up to half; nothing adds any, so that more tells of a wrong
# mass, unit or plate.
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
        settings = Settings(
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
        """Take the next samples of both legs; give the strides that they complete.

        Raises
        ------
        GaitInputError
            For channels of different lengths.
        """
        chunk = read_chunk(CHANNELS, (t_s, *_fill_up(left), *_fill_up(right)))
        strides: list[Stride] = []
        for piece, count in cut(chunk, self._left.piece):
            first = self._samples.end
            self._samples.append(piece, count)
            stop = self._samples.end
            left_found = self._left.advance(first, stop)
            right_found = self._right.advance(first, stop)
            if left_found or right_found:
                strides += self._tell(left_found, right_found)
        return strides

    def finish(self) -> list[Stride]:
        """Give what still waits, and the stances that the end of the samples cuts off, invalid."""
        return self._tell(self._left.finish(), self._right.finish())

    def _tell(self, left: list[Draft], right: list[Draft]) -> list[Stride]:
        """Give the strides of both legs, in the order in which they were complete."""
        found = [(draft, self._left, self._right) for draft in left]
        found += [(draft, self._right, self._left) for draft in right]
        found.sort(key=lambda one: (one[0].index, one[0].contact.end_index))
        return [leg.tell(draft, self._compare(draft, leg, other)) for draft, leg, other in found]

    def _compare(self, draft: Draft, leg: LegDetector, other: LegDetector) -> Beside:
        """Give what the other leg did until the sample that completed a stride."""
        this, is_whole = draft.contact, Reason.CUT_OFF not in draft.reasons
        reasons: list[Reason] = []
        flags: list[Flag] = []
        known = _find_contacts(other, draft.index)
        since = max(this.begin_index, draft.index - leg.memory)
        others = [c for c in known if c.begin_index < _end(this) and _end(c) > since]
        first = others[0] if others else None
        second = others[1] if len(others) == 2 else None
        if is_whole and (first is None or second is None or not _is_walked(first, this, second)):
            if Reason.LONG_STANCE not in draft.reasons:
                reasons.append(Reason.CROSS_STEP)
            first = second = None
        plates, zeros_n = (leg, other), (this.offset_n, known[-1].offset_n if known else 0.0)
        ratio = carried = _weigh(draft.cycle_index, this.begin_index, plates, zeros_n)
        if ratio is None and second is not None:
            # No whole cycle was seen: a step comes near enough to tell a wrong mass.
            carried = _weigh(this.begin_index, second.begin_index, plates, zeros_n)
        if carried is not None and not WEIGHT_MIN <= carried <= WEIGHT_MAX:
            reasons.append(Reason.WEIGHT)
        elif ratio is not None and ratio < SUPPORTED_BELOW:
            flags.append(Flag.SUPPORTED)
        length = None if first is None else _find_length(draft.stance, other, this.begin_index)
        symmetry = _find_symmetry(length, self._steps_m.get(other.side))
        self._steps_m[leg.side] = length
        return Beside(
            reasons=reasons,
            flags=flags,
            step_s=_find_time(first.begin_s, this.begin_s) if first and first.seen else None,
            step_length_m=length,
            step_symmetry=symmetry,
            first_double_support_s=_find_time(this.begin_s, first.end_s) if first else None,
            second_double_support_s=_find_time(second.begin_s, this.end_s) if second else None,
            weight_ratio=ratio,
        )


def _fill_up(leg: LegSamples | Sequence[ArrayLike]) -> Sequence[ArrayLike | None]:
    return leg if len(leg) == len(NAMES) else LegSamples(*leg)


def _weigh(
    begin: int | None,
    end: int,
    plates: tuple[LegDetector, LegDetector],
    zeros_n: tuple[float, float],
) -> float | None:
    """Give the mean force of both plates between two samples, by body weight, if it is known."""
    if begin is None:
        return None
    load = sum(
        leg.find_load(begin, end, zero_n) for leg, zero_n in zip(plates, zeros_n, strict=True)
    )
    return load if math.isfinite(load) else None


def _is_walked(first: Contact, this: Contact, second: Contact) -> bool:
    """Say whether the other foot left after this one came and came before it left, as in walking.

    A foot that stands alone for longer than a walker's has another one on its plate.
    """
    alone = second.begin_index - _end(first)
    stance = _end(this) - this.begin_index
    return first.begin_index < this.begin_index and 0 < alone < ALONE_MAX * stance


def _end(contact: Contact) -> float:
    return math.inf if contact.end_index is None else contact.end_index


def _find_contacts(leg: LegDetector, index: int) -> list[Contact]:
    """Give a leg's contacts as they were known at sample ``index``, whatever came later."""
    contacts = []
    for contact in leg.contacts.recent:
        end = contact.end_index
        if contact.begin_index > index:
            break
        if end is None or end > index:
            begin = max(contact.begin_index, index - leg.piece)
            peak_n = find_highest(leg.buffer.channel(FORCE, begin, index + 1)) - contact.offset_n
            if not peak_n >= STEP_PEAK * leg.weight_n:
                continue
            if end is not None:
                contact = replace(contact, end_index=None, end_s=None)  # noqa: PLW2901
        contacts.append(contact)
    return contacts


def _find_time(begin_s: float, end_s: float | None) -> float | None:
    """Give the time between two moments, if both are known."""
    if end_s is None or not math.isfinite(end_s - begin_s):
        return None
    return end_s - begin_s


def _find_length(stance: Stance, other: LegDetector, index: int) -> float | None:
    """Give how far the foot landed ahead of the other one."""
    if stance.position_m is None:
        return None
    position = float(other.buffer.channel(POSITION, index, index + 1)[0])
    length = stance.position_m - position
    return length if math.isfinite(length) else None


def _find_symmetry(this_m: float | None, other_m: float | None) -> float | None:
    if this_m is None or other_m is None or not this_m + other_m > 0:
        return None
    return (this_m - other_m) / (this_m + other_m)
