"""The steps of one source that the server has not acknowledged, and which of them to send next."""

from __future__ import annotations

import json
import math
from collections import deque
from typing import Any, NamedTuple

from rehab.training.steps import InvalidReason, Measurement
from robot.wire.frames import NAME
from robot.wire.limits import MAX_EXTRA, MAX_FRAME_BYTES, MAX_REASONS, MAX_STEPS

Message = dict[str, Any]

FRAME_BYTES = MAX_FRAME_BYTES - 4 * 1024  # leaves room for the frame around the steps
OWN_REASONS = (InvalidReason.PAUSED, InvalidReason.NOT_FINITE)  # reasons that are added here


class UnsendableStride(ValueError):
    """A stride that does not fit the protocol; the message says how to make it fit."""


class StepsLost(RuntimeError):
    """The server no longer has steps that it acknowledged."""


class _QueuedStep(NamedTuple):
    number: int
    step: Message
    size: int  # [bytes]


def add_own_reason(reasons: tuple[str, ...], reason: str) -> tuple[str, ...]:
    """Return a source's reasons with one of ours; its last ones are dropped beyond the limit."""
    ours = [one for one in OWN_REASONS if one in reasons or one == reason]
    others = [one for one in reasons if one not in OWN_REASONS]
    return (*others[: MAX_REASONS - len(ours)], *ours)


def write_step(measurement: Measurement, number: int) -> Message:
    """Return a stride as the protocol writes it. Raises UnsendableStride.

    A value that is not finite becomes null with its reason: JSON cannot express it.
    """
    value, reasons = measurement.value, measurement.reasons
    if value is not None and not math.isfinite(value):
        value, reasons = None, add_own_reason(reasons, InvalidReason.NOT_FINITE)
    step: Message = {
        "number": number,
        "time_s": measurement.time_s,
        "side": str(measurement.side),
        "value": value,
    }
    if reasons:
        step["reasons"] = [str(reason) for reason in reasons]
    if measurement.extra:
        step["extra"] = dict(measurement.extra)
    _check_names(measurement, reasons)
    return step


def _check_names(measurement: Measurement, reasons: tuple[str, ...]) -> None:
    if len(reasons) > MAX_REASONS or len(measurement.extra) > MAX_EXTRA:
        raise UnsendableStride(
            f"Stride {measurement.number} has {len(measurement.extra)} extra values and "
            f"{len(reasons)} reasons; {MAX_EXTRA} and {MAX_REASONS} can be sent. Leave columns out."
        )
    for name in (*reasons, *measurement.extra):
        if not NAME.fullmatch(name):
            raise UnsendableStride(
                f"Stride {measurement.number}: the name {name[:80]!r} cannot be sent. Rename that "
                "column or reason to at most 64 letters, digits or _ . : -"
            )


class StepQueue:
    """Keeps a source's steps in order until the server has stored them.

    It numbers strides as the current session needs it, decides which steps to send next and never
    lets more than ``MAX_STEPS`` be in flight. It sends nothing itself.
    """

    def __init__(self) -> None:
        self.session: int | None = None
        self.last = 0  # the last number given in this session; 0 for none
        self._next = 1
        self._kept: deque[_QueuedStep] = deque()
        self._sent = 0  # how many of the kept, from the oldest on, are in flight

    @property
    def unacknowledged(self) -> int:
        """How many steps are kept."""
        return len(self._kept)

    @property
    def in_flight(self) -> int:
        """How many steps were sent and are not acknowledged."""
        return self._sent

    @property
    def can_send(self) -> bool:
        """Whether a step can be sent now."""
        return self._sent < min(len(self._kept), MAX_STEPS)

    @property
    def next_is_paused(self) -> bool:
        """Whether the next step to send was walked while the session was paused."""
        waiting = self._kept[self._sent] if self._sent < len(self._kept) else None
        return waiting is not None and InvalidReason.PAUSED in waiting.step.get("reasons", ())

    def join(self, session: int, next_number: int) -> None:
        """Apply a welcome: the session to go on in, and the number to go on from.

        Steps below ``next_number`` stay kept until an acknowledgment covers them: the server has
        received them, which is not yet stored. The last of them is sent once more, to be
        acknowledged again. Raises StepsLost where steps are wanted that were acknowledged.
        """
        if session != self.session:
            self.leave()
            self.session = session
        if self.last:
            first = self._kept[0].number if self._kept else self.last + 1
            if next_number < first:
                raise StepsLost(
                    f"The server wants step {next_number} of session {session} and has "
                    f"acknowledged up to {first - 1}: it seems to run on an older copy of its "
                    "database. Begin anew with a new run to go on from where the server is."
                )
            again_from = min(next_number - 1, self.last)
            self._sent = sum(kept.number < again_from for kept in self._kept)
        self._next = max(next_number, self.last + 1)

    def leave(self) -> int:
        """Leave the session; return how many of its steps were not acknowledged and are dropped."""
        lost = len(self._kept)
        self._kept.clear()
        self.session, self.last, self._next, self._sent = None, 0, 1, 0
        return lost

    def add(self, measurement: Measurement) -> int:
        """Keep a stride to be sent and return its number. Raises UnsendableStride."""
        number = self._next
        step = write_step(measurement, number)
        self._kept.append(_QueuedStep(number, step, len(json.dumps(step))))
        self.last = number
        self._next = number + 1
        return number

    def next_frame(self) -> Message | None:
        """Return the next frame to send, None for nothing; its steps are in flight then."""
        steps: list[Message] = []
        room = FRAME_BYTES
        while self.can_send and room >= (kept := self._kept[self._sent]).size:
            steps.append(kept.step)
            room -= kept.size
            self._sent += 1
        if not steps:
            return None
        return {"type": "step"} | steps[0] if len(steps) == 1 else {"type": "steps", "steps": steps}

    def acknowledge(self, number: int) -> None:
        """Drop every step up to this number."""
        while self._kept and self._kept[0].number <= number:
            self._kept.popleft()
            self._sent = max(0, self._sent - 1)

    def rewind(self) -> None:
        """Mark all steps as not sent: they were refused and have to be sent again."""
        self._sent = 0
