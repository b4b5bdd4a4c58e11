"""The steps of one source that the server has not acknowledged, and which of them to send next."""

from __future__ import annotations

import json
import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from rehab.sources.client.journal import Journal
from rehab.sources.client.journal_state import JournalState
from rehab.training.steps import InvalidReason, Measurement
from robot.wire.frames import NAME
from robot.wire.limits import MAX_EXTRA, MAX_FRAME_BYTES, MAX_REASONS, MAX_STEPS
from robot.wire.remote_clock import LATE_STEP_S

Message = dict[str, Any]

FRAME_BYTES = MAX_FRAME_BYTES - 4 * 1024  # leaves room for the frame around the steps
LATE_BYTES = len(', "late": true')
OWN_REASONS = (InvalidReason.PAUSED, InvalidReason.NOT_FINITE)  # reasons that are added here


class UnsendableStride(ValueError):
    """A stride that does not fit the protocol; the message says how to make it fit."""


class StepsLost(RuntimeError):
    """The server no longer has steps that it acknowledged."""


class _QueuedStep(NamedTuple):
    number: int
    step: Message
    size: int  # [bytes]
    since_s: float  # when it was added, by our clock

    def is_late(self, now_s: float) -> bool:
        return now_s - self.since_s > LATE_STEP_S


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

    Parameters
    ----------
    journal
        Where steps are kept over the end of this program; only in memory by default.
    marks_late
        Whether to mark for the server which steps come long after they were measured, as is known
        here whatever the server has learned of the source's clock.
    monotonic
        Our clock [s].

    Attributes
    ----------
    side, state
        Of the session, for the journal.
    """

    def __init__(
        self,
        journal: Journal | None = None,
        *,
        marks_late: bool = False,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self.side = self.state = ""
        self._journal, self._marks_late, self._monotonic = journal, marks_late, monotonic
        self.session: int | None = None
        self.last = 0  # the last number given in this session; 0 for none
        self._next = 1
        self._kept: deque[_QueuedStep] = deque()
        self._sent = 0  # how many of the kept, from the oldest on, are in flight
        self._unsent_from: int | None = None
        if journal is not None and journal.saved.session is not None:
            saved = journal.saved
            self.session, self.side, self.state = saved.session, saved.side, saved.state
            self.last, self._next = saved.last, saved.last + 1
            self._unsent_from = saved.unsent_from
            self._keep(saved.steps, -math.inf)

    @property
    def unacknowledged(self) -> int:
        """How many steps are kept."""
        return len(self._kept)

    @property
    def can_send(self) -> bool:
        """Whether a step can be sent now."""
        return self._sent < min(len(self._kept), MAX_STEPS)

    @property
    def next_is_paused(self) -> bool:
        """Whether the next step to send was walked while the session was paused."""
        waiting = self._kept[self._sent] if self._sent < len(self._kept) else None
        return waiting is not None and InvalidReason.PAUSED in waiting.step.get("reasons", ())

    def join(self, session: int, next_number: int, side: str = "") -> int:
        """Apply a welcome: the session, its trained leg, and the number to go on from.

        Return how many kept steps are dropped.

        Steps below ``next_number`` stay kept until an acknowledgment covers them: the server has
        received them, which is not yet stored. The last of them is sent once more, to be
        acknowledged again. Steps that were measured after a restart and before this welcome get
        numbers anew where the server has more than is known here: it had stored what the journal
        lost with the power. Where after a restart it has less than it had acknowledged, all that is
        kept is put aside: a server that was set back may have given the session's number again, to
        another one's. Raises StepsLost where steps are wanted that were acknowledged since.
        """
        if session != self.session:
            self.leave()
            self.session, self.side = session, side
        unsent_from, self._unsent_from = self._unsent_from, None
        dropped = 0
        first = self._kept[0].number if self._kept else self.last + 1
        if unsent_from is not None and unsent_from < next_number:
            self._number_anew(unsent_from, next_number)
        elif unsent_from is not None and next_number < first:
            if self._kept and self._journal is not None:
                self._journal.put_aside()
            dropped = self.leave()
            self.session, self.side = session, side
        if self.last:
            if next_number < first:
                raise StepsLost(
                    f"The server wants step {next_number} of session {session} and has "
                    f"acknowledged up to {first - 1}: it seems to run on an older copy of its "
                    "database. Begin anew with a new run to go on from where the server is."
                )
            again_from = min(next_number - 1, self.last)
            self._sent = sum(kept.number < again_from for kept in self._kept)
        self._next = max(next_number, self.last + 1)
        if self._journal is not None:
            self._journal.renew(self._all())
        return dropped

    def _number_anew(self, old: int, new: int) -> None:
        """Set the numbers of the steps from ``old`` on to those from ``new`` on."""
        kept = list(self._kept)
        self._kept.clear()
        for one in kept:
            by = new - old if one.number >= old else 0
            self._keep([one.step | {"number": one.number + by}], one.since_s)
        self.last = self._kept[-1].number if self._kept else new - 1

    def note_state(self, state: str) -> None:
        """Note the session's state, in which a source that starts again goes on."""
        if state != self.state:
            self.state = state
            self._note({"state": state})

    def _note(self, entry: Message) -> None:
        if self._journal is not None:
            self._journal.note(entry, self._all)

    def _all(self) -> JournalState:
        steps = [kept.step for kept in self._kept]
        return JournalState(
            self.session, self.side, self.state, self.last, self._unsent_from, steps
        )

    def _keep(self, steps: list[Message], since_s: float) -> None:
        for step in steps:
            size = len(json.dumps(step)) + LATE_BYTES
            self._kept.append(_QueuedStep(step["number"], step, size, since_s))

    def leave(self) -> int:
        """Leave the session; return how many of its steps were not acknowledged and are dropped."""
        lost = len(self._kept)
        self._kept.clear()
        self.session, self.last, self._next, self._sent = None, 0, 1, 0
        self.side, self.state, self._unsent_from = "", "", None
        if self._journal is not None:
            self._journal.renew(self._all())
        return lost

    def add(self, measurement: Measurement) -> int:
        """Keep a stride to be sent and return its number. Raises UnsendableStride."""
        number = self._next
        step = write_step(measurement, number)
        self._keep([step], self._monotonic())
        self.last = number
        self._next = number + 1
        self._note({"step": step})
        return number

    def next_frame(self) -> Message | None:
        """Return the next frame to send, None for nothing; its steps are in flight then."""
        steps: list[Message] = []
        room, now_s = FRAME_BYTES, self._monotonic()
        while self.can_send and room >= (kept := self._kept[self._sent]).size:
            late = self._marks_late and kept.is_late(now_s)
            steps.append(kept.step | {"late": True} if late else kept.step)
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
        self._note({"ack": number})

    def rewind(self) -> None:
        """Mark all steps as not sent: they were refused and have to be sent again."""
        self._sent = 0
