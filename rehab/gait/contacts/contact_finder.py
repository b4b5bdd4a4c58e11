"""Contacts of a foot with the floor, from the vertical force under it.

Initial and terminal contact by two thresholds (hysteresis), with debouncing and baseline (zero)
tracking; the reference is docs/reference/gait.md#contacts.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from rehab.gait.contacts.chunk_wait import ChunkWait
from rehab.gait.contacts.contact import Contact
from rehab.gait.contacts.drag import REST_N, find_edge
from rehab.gait.contacts.zero import PlateZero, find_finite_median
from rehab.gait.signals.buffer import LegBuffer
from rehab.gait.signals.filters import Floats, find_finite_maximum, find_last
from rehab.gait.signals.samples import FORCE, TIME

# Force is not filtered here: 20 Hz of causal filter would move both events by 10 ms
# (docs/reference/gait.md#contacts).
CONTACT_N = 30.0  # 6 times the noise of an unloaded treadmill plate (4.5 N sd)
RELEASE_N = 20.0  # there both ends of a contact are timed
STEP_PEAK = 0.25  # of body weight; a contact that never bears more is no step
BOUNCE_S = 0.15  # debounce: no foot swings faster; a sooner contact continues the last stance
# A foot that is dragged over the belt loads its plate by 60 N and more in swing. A contact is
# certain above that; its ends are timed at the release threshold where the force gets there and no
# drag is found, else by slope and dip (`drag`).
CERTAIN = 0.2  # of body weight; at 0.15 a drag of 90 N goes on in a person of 60 kg
LOOK_BACK_S = 0.25  # from there to the release threshold, for a foot that is loaded slowly
DRAG_S, LOOK_EVERY_S = 0.08, 0.02  # after so long of an uncertain contact a drag is looked for
SHORTEST_S = 0.15  # no contact that ends sooner can be a valid stance, by any clock
STUCK_S = 4.5  # in contact for longer: standing, or the plate's zero has moved above the threshold
BLOCK_S = 0.1
AROUND_S = 0.015  # around both ends of a swing, where a plate bears least if the foot is dragged


class ContactFinder:
    """Finds contacts by hysteresis and tracks the plate's zero in swing.

    A contact is certain at 0.2 of the body weight, ``contact_n`` at least; its beginning and
    end are timed where the force crosses ``release_n``, by linear interpolation between samples.
    Those of a foot that is dragged are found by ``drag.find_edge``.

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
        self.current: Contact | None = None  # under way
        self._buffer = buffer
        self._rate_hz = rate_hz
        self._weight_n = weight_n
        self._contact_n = max(contact_n, CERTAIN * weight_n)
        self._release_n = release_n
        self._zero = PlateZero(weight_n, rate_hz)
        self._around = math.ceil(AROUND_S * rate_hz)
        self._last: Contact | None = None  # the last step
        self._zero_index = 0  # swing samples before this belong to another zero
        self._stuck_index = 0
        self._end_index = 0  # of the newest contact
        self._low_index: int | None = None  # since when the force of a contact is not certain
        self._look_index = 0  # when a drag is looked for in a contact that is not certain
        self._dragged = round(DRAG_S * rate_hz)
        self._shortest = int(SHORTEST_S * rate_hz)
        self._look_every = max(2, round(LOOK_EVERY_S * rate_hz))

    @property
    def offset_n(self) -> float:
        """The plate's zero [N]."""
        return self._zero.offset_n

    @property
    def certain_n(self) -> float:
        """The force above which a contact is certain [N]."""
        return self._zero.offset_n + self._contact_n

    def find_wait(self, stop: int) -> ChunkWait:
        """Return for which force the samples from ``stop`` on may wait for others."""
        contact, certain_n = self.current, self.certain_n
        if contact is None:
            return ChunkWait(most_n=certain_n, young=self._shortest)
        young = contact.begin_index + self._shortest - stop
        low = self._dragged if self._low_index is None else self._look_index - stop
        free_n = self.offset_n + self._release_n + REST_N
        return ChunkWait(least_n=certain_n, young=young, low=low, free_n=free_n)

    def advance(self, start: int, stop: int) -> list[Contact]:
        """Process new samples ``start:stop`` and return the steps that ended in them."""
        force = self._buffer.channel(FORCE, start, stop)
        ended: list[Contact] = []
        done = 0
        while done < len(force):
            rest = force[done:] if done else force
            if self.current is None:
                limit = self.certain_n
                if rest.item(rest.argmax()) <= limit:  # false for NaN, too
                    break
                loaded = rest > limit
                step = int(loaded.argmax())
                if not loaded[step]:
                    break
                done += step
                self._begin(start + done)
            else:
                until = self._stuck_index - start - done  # exclusive, whatever the chunks
                if until <= len(rest):
                    rest = rest[:until]
                left = self._find_end(rest, start + done, ended)
                if left is not None:
                    done = left - start
                    continue
                done += len(rest)
                if start + done >= self._stuck_index:
                    self._recover_from_drift(start + done)
        return ended

    def _find_end(self, rest: Floats, start: int, ended: list[Contact]) -> int | None:
        """End the contact if it ends in these samples; return the sample from which to go on."""
        certain_n, release_n = self.certain_n, self.offset_n + self._release_n
        if not len(rest) or rest.item(rest.argmin()) >= certain_n:
            self._low_index = None
            return None
        low = ~(rest >= certain_n)
        done = 0
        while done < len(rest):
            if self._low_index is None:
                step = int(low[done:].argmax())
                if not low[done + step]:
                    return None
                done += step
                self._low_index = start + done
                self._look_index = start + done + self._dragged
            again = int((~low[done:]).argmax())
            stop = len(rest) if low[done + again] else done + again
            due = self._look_index - start
            part = rest[done : min(stop, due + 1)]
            free = part < release_n
            step = int(free.argmax()) if len(free) else 0
            if len(free) and free[step]:
                at = start + done + step
                found = None
                if at - self._low_index >= self._dragged // 2:
                    found = self._find_drag_end(self._low_index, at, self._release_n + REST_N)
                self._end(*(found or self._find_crossing(at)), at, ended)
                return at
            if due < stop:
                found = self._find_drag_end(self._low_index, start + due, 0.0)
                if found is not None:
                    self._end(*found, start + due, ended)
                    return start + due
                self._look_index += self._look_every
                done = max(done, due)
                continue
            done = stop
            if stop < len(rest):
                self._low_index = None
        return None

    def _find_drag_end(self, low: int, last: int, least_n: float) -> tuple[int, float] | None:
        """Return at which sample and when [s] a stance ended whose foot drags on, if it did."""
        contact = self.current
        assert contact is not None  # noqa: S101 (for mypy)
        if not self._is_step(contact, low):
            return None
        first = max(contact.begin_index, low - self._look_every)
        force = self._buffer.channel(FORCE, first, last + 1)
        edge = find_edge(force, self._rate_hz, self.offset_n, self._release_n, least_n)
        return None if edge is None else self._find_place(first + edge)

    def _find_place(self, place: float) -> tuple[int, float]:
        """Return the first sample behind a place between samples, and the time of the place [s]."""
        index = max(1, math.ceil(place))
        t0, t1 = self._buffer.channel(TIME, index - 1, index + 1).tolist()
        return index, t0 + (place - index + 1) * (t1 - t0)

    def _find_crossing(self, index: int) -> tuple[int, float]:
        """Return a sample, and when the force crossed the release threshold before it [s]."""
        return index, self._buffer.find_crossing(FORCE, index, self.offset_n + self._release_n)

    def truncate(self) -> Contact | None:
        """Return the step under way, as if it ended with the last sample, if there is one."""
        contact, self.current = self.current, None
        stop = self._buffer.samples.end
        if contact is None or not contact.is_onset_seen or contact.is_bounce:
            return None
        contact.end_index = stop - 1
        contact.end_s = float(self._buffer.channel(TIME, stop - 1, stop)[0])
        return contact if self._is_step(contact, stop) else None

    def _begin(self, index: int) -> None:
        buffer = self._buffer
        back = int(LOOK_BACK_S * self._rate_hz)
        first = max(self._end_index, buffer.samples.first, index - back)
        before = buffer.channel(FORCE, first, index)
        loading = buffer.channel(FORCE, first, index + 1)[::-1]
        edge = find_edge(loading, self._rate_hz, self.offset_n, self._release_n, REST_N)
        below = find_last(before <= self.offset_n + self._release_n)
        seen = edge is not None or below >= 0
        if edge is not None:
            at, time_s = self._find_place(max(index - edge, first))
        elif seen:
            at, time_s = self._find_crossing(first + below + 1)
        else:
            at, time_s = index, float(buffer.channel(TIME, index, index + 1)[0])
        last = self._last
        bounce = last is not None and last.end_s is not None and 0 <= time_s - last.end_s < BOUNCE_S
        if seen and not bounce:
            self._learn_zero(at)
        self.current = Contact(at, time_s, self.offset_n, seen, bounce)
        self._drop_before(index - self._buffer.samples.keep)
        self.recent.append(self.current)
        self._stuck_index = index + int(STUCK_S * self._rate_hz)
        self._low_index = None

    def _drop_before(self, index: int) -> None:
        recent = self.recent
        while len(recent) > 1 and (end := recent[1].end_index) is not None and end < index:
            recent.popleft()

    def _end(self, index: int, time_s: float, known: int, ended: list[Contact]) -> None:
        """End the contact at a sample and time [s], known at another sample."""
        contact = self.current
        assert contact is not None  # noqa: S101 (for mypy)
        contact.end_index, contact.known_index = index, known
        contact.end_s, self._end_index = time_s, index
        self.current = self._low_index = None
        if not self._is_step(contact, index):
            self.recent.pop()  # it is the newest
        elif math.isfinite(contact.begin_s) and math.isfinite(contact.end_s):
            self._last = contact
            ended.append(contact)

    def _is_step(self, contact: Contact, stop: int) -> bool:
        """Find the peak of a contact until ``stop``; return whether it is that of a step."""
        begin = max(contact.begin_index, stop - self._buffer.samples.keep // 2)
        contact.peak_n = (
            find_finite_maximum(self._buffer.channel(FORCE, begin, stop)) - contact.offset_n
        )
        return contact.peak_n >= STEP_PEAK * self._weight_n

    def _learn_zero(self, index: int) -> None:
        """Learn the plate's zero from the swing that ends at ``index``."""
        last = self._last
        begin = self._zero_index if last is None or last.end_index is None else last.end_index
        begin = max(begin, self._zero_index, index - self._buffer.samples.keep // 2)
        margin = (index - begin) // 5
        swing = self._buffer.channel(FORCE, begin + margin, index - margin)
        middles = (begin, index) if last is not None and last.end_index == begin else ()
        self._zero.learn(swing, [self._find_around(at, index) for at in middles])

    def _find_around(self, middle: int, stop: int) -> Floats:
        """Return the force around a contact, before sample ``stop``."""
        first = max(middle - self._around, self._buffer.samples.first)
        return self._buffer.channel(FORCE, first, min(middle + self._around, stop) + 1)

    def _recover_from_drift(self, index: int) -> None:
        """Reset the plate's zero where it has drifted so far that a contact does not end.

        The lowest tenth of a second counts as a swing if it lies near enough to zero.
        """
        block = int(BLOCK_S * self._rate_hz)
        self._stuck_index = index + int(STUCK_S * self._rate_hz)
        first = max(0, index - int(STUCK_S * self._rate_hz))
        force = self._buffer.channel(FORCE, first, index)
        blocks = force[len(force) % block :].reshape(-1, block)
        lowest = min((find_finite_median(b) for b in blocks), default=np.inf)
        if not self._zero.reset(lowest):
            return
        self._zero_index = index
        if force[-1] > lowest + self._contact_n:
            return  # in stance now; its end will be seen with the new zero
        if self.current is not None:
            self.current.end_index = self.current.known_index = index
        self.current = self._low_index = None
        self._last = None
