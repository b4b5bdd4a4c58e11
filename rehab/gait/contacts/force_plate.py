"""Contacts of a foot with the floor, from the vertical force under it."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from rehab.gait.signals.buffer import LegBuffer
from rehab.gait.signals.filters import Floats, find_maximum, find_upper_median
from rehab.gait.signals.samples import FORCE, TIME

# Force is not filtered here: 20 Hz of causal filter would move both events by 10 ms
# (docs/reference/gait.md#contacts).
CONTACT_N = 30.0  # 6 times the noise of an unloaded treadmill plate (4.5 N sd)
RELEASE_N = 20.0
STEP_PEAK = 0.25  # of body weight; a contact that never bears more is no step
BOUNCE_S = 0.15  # no foot swings faster; a contact sooner than that goes on with the last stance
LOOK_BACK_S = 0.05  # loading takes less from release to contact threshold
OFFSET_MAX = 0.15  # of body weight; a plate that reads more in swing needs its own zero button
OFFSET_SWINGS = 10
STUCK_S = 2.5  # in contact for longer: standing, or the plate's zero has moved above the threshold
BLOCK_S = 0.1


@dataclass(slots=True, eq=False)
class Contact:
    """One contact of a foot with its plate. Indices count samples since the start.

    Attributes
    ----------
    begin_index, begin_s, end_index, end_s
        When the foot met and left the floor; None until it left.
    offset_n
        What the plate read in the swing before [N].
    is_onset_seen
        Whether its beginning was observed (not so at the start of the record or after a loss).
    is_bounce
        Whether it only continues the stance before it.
    peak_n
        Largest force above the offset [N], once the contact has ended.
    """

    begin_index: int
    begin_s: float
    offset_n: float
    is_onset_seen: bool
    is_bounce: bool
    end_index: int | None = None
    end_s: float | None = None
    peak_n: float = 0.0


class ContactFinder:
    """Finds contacts by hysteresis and tracks the plate's zero in swing.

    A contact is certain at ``contact_n``; its beginning and end are timed where the force crosses
    ``release_n``, by linear interpolation between samples.

    Parameters
    ----------
    buffer
        The leg's samples.
    rate_hz, weight_n
        Nominal rate of the samples, and body weight [N].
    contact_n, release_n
        Thresholds above the plate's zero [N] (docs/reference/gait.md#contacts).
    """

    def __init__(
        self,
        buffer: LegBuffer,
        rate_hz: float,
        weight_n: float,
        contact_n: float = CONTACT_N,
        release_n: float = RELEASE_N,
    ) -> None:
        # The contacts of the buffered samples, and the last one before them.
        self.recent: deque[Contact] = deque()
        self.offset_n = 0.0
        self._buffer = buffer
        self._rate_hz = rate_hz
        self._weight_n = weight_n
        self._contact_n = contact_n
        self._release_n = release_n
        self._offsets: deque[float] = deque(maxlen=OFFSET_SWINGS)
        self._current: Contact | None = None
        self._last: Contact | None = None  # the last step
        self._zero_index = 0  # swing samples before this belong to another zero
        self._stuck_index = 0

    def advance(self, start: int, stop: int) -> list[Contact]:
        """Process new samples ``start:stop`` and return the steps that ended in them."""
        ended: list[Contact] = []
        force = self._buffer.channel(FORCE, start, stop)
        done = 0
        while done < len(force):
            rest = force[done:] if done else force
            if self._current is None:
                limit = self.offset_n + self._contact_n
                if rest[rest.argmax()] <= limit:  # false for NaN, too
                    break
                loaded = rest > limit
                step = int(loaded.argmax())
                if not loaded[step]:
                    break
                done += step
                self._begin(start + done)
            else:
                limit = self.offset_n + self._release_n
                until = self._stuck_index - start - done  # exclusive, whatever the chunks
                if until <= len(rest):
                    rest = rest[:until]
                if len(rest) and not rest[rest.argmin()] >= limit:
                    free = rest < limit
                    step = int(free.argmax())
                    if free[step]:
                        done += step
                        self._end(start + done, ended)
                        continue
                done += len(rest)
                if start + done >= self._stuck_index:
                    self._recover_from_drift(start + done)
        return ended

    def truncate(self) -> Contact | None:
        """Return the step under way, as if it ended with the last sample, if there is one."""
        contact, self._current = self._current, None
        stop = self._buffer.samples.end
        if contact is None or not contact.is_onset_seen or contact.is_bounce:
            return None
        contact.end_index = stop - 1
        contact.end_s = float(self._buffer.channel(TIME, stop - 1, stop)[0])
        return contact if self._is_step(contact, stop) else None

    def _begin(self, index: int) -> None:
        buffer, level = self._buffer, self.offset_n + self._release_n
        first = max(0, index - max(2, int(LOOK_BACK_S * self._rate_hz)))
        before = buffer.channel(FORCE, first, index)
        below = np.flatnonzero(before <= level)
        seen = len(below) > 0
        at = first + int(below[-1]) + 1 if seen else index
        time_s = (
            self._interpolate_crossing(at, level)
            if seen
            else float(buffer.channel(TIME, at, at + 1)[0])
        )
        last = self._last
        bounce = last is not None and last.end_s is not None and 0 <= time_s - last.end_s < BOUNCE_S
        if seen and not bounce:
            self._update_offset(at)
        self._current = Contact(at, time_s, self.offset_n, seen, bounce)
        self._drop_before(index - self._buffer.samples.keep)
        self.recent.append(self._current)
        self._stuck_index = index + int(STUCK_S * self._rate_hz)

    def _drop_before(self, index: int) -> None:
        recent = self.recent
        while len(recent) > 1 and (end := recent[1].end_index) is not None and end < index:
            recent.popleft()

    def _end(self, index: int, ended: list[Contact]) -> None:
        contact = self._current
        assert contact is not None  # noqa: S101 (for mypy)
        contact.end_index = index
        contact.end_s = self._interpolate_crossing(index, self.offset_n + self._release_n)
        self._current = None
        if not self._is_step(contact, index):
            self.recent.pop()  # it is the newest
        elif math.isfinite(contact.begin_s) and math.isfinite(contact.end_s):
            self._last = contact
            ended.append(contact)

    def _is_step(self, contact: Contact, stop: int) -> bool:
        """Find the peak of a contact until ``stop``; return whether it is that of a step."""
        begin = max(contact.begin_index, stop - self._buffer.samples.keep // 2)
        contact.peak_n = _find_peak(self._buffer.channel(FORCE, begin, stop)) - contact.offset_n
        return contact.peak_n >= STEP_PEAK * self._weight_n

    def _interpolate_crossing(self, index: int, level: float) -> float:
        """Return when the force crossed a level between samples ``index - 1`` and ``index`` [s]."""
        if index == 0:
            return float(self._buffer.channel(TIME, index, index + 1)[0])
        (t0, t1), (f0, f1) = self._buffer.view(index - 1, index + 1)[:2].tolist()
        share = (level - f0) / (f1 - f0) if f1 != f0 else 1.0
        crossed: float = t0 + share * (t1 - t0) if 0 <= share <= 1 else t1  # t1 beside NaN
        return crossed

    def _update_offset(self, index: int) -> None:
        """Learn the plate's zero from the median of the swing that ends at ``index``."""
        last = self._last
        begin = self._zero_index if last is None or last.end_index is None else last.end_index
        begin = max(begin, self._zero_index, index - self._buffer.samples.keep // 2)
        margin = (index - begin) // 5
        swing = self._buffer.channel(FORCE, begin + margin, index - margin)
        if len(swing) < max(3, int(BLOCK_S * self._rate_hz / 2)):
            return
        zero = _find_finite_median(swing)
        if abs(zero) <= OFFSET_MAX * self._weight_n:
            self._offsets.append(zero)
            self.offset_n = sorted(self._offsets)[len(self._offsets) // 2]

    def _recover_from_drift(self, index: int) -> None:
        """Reset the plate's zero where it has drifted so far that a contact does not end.

        The lowest tenth of a second counts as a swing if it lies near enough to zero.
        """
        block = max(1, int(BLOCK_S * self._rate_hz))
        self._stuck_index = index + int(STUCK_S * self._rate_hz)
        first = max(0, index - int(STUCK_S * self._rate_hz))
        force = self._buffer.channel(FORCE, first, index)
        blocks = force[len(force) % block :].reshape(-1, block)
        lowest = min((_find_finite_median(b) for b in blocks), default=np.inf)
        if abs(lowest) > OFFSET_MAX * self._weight_n or abs(lowest - self.offset_n) < 5.0:
            return
        self.offset_n = lowest
        self._offsets.clear()
        self._zero_index = index
        if force[-1] > lowest + self._contact_n:
            return  # in stance now; its end will be seen with the new zero
        if self._current is not None:
            self._current.end_index = index
        self._current = None
        self._last = None


def _find_peak(force: Floats) -> float:
    """Return the largest finite value, 0 without one."""
    peak = find_maximum(force) if len(force) else 0.0
    if math.isfinite(peak):
        return peak
    finite = force[np.isfinite(force)]
    return float(finite.max()) if len(finite) else 0.0


def _find_finite_median(values: Floats) -> float:
    """Return the median of the finite values, infinity without one."""
    if np.isfinite(values).all():
        return find_upper_median(values)
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else np.inf
