"""Steps that a source sends again: whether they are the stored ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from channels.db import database_sync_to_async

from rehab.sessions.log import RULE_PAUSES, SessionEvent, Step
from rehab.training.changes import ChangeKind, State
from rehab.training.controls import CONTROLS
from rehab.training.measures import Measure
from rehab.training.steps import (
    InvalidReason,
    Measurement,
    add_reason,
    find_invalid_reasons,
    select_value,
)
from robot.wire.frames import BadFrame


@database_sync_to_async
def check_same(
    session_id: int, measurement: Measurement, measure: Measure, next_number: int
) -> None:
    """Raise BadFrame where the stored step of that number has other content, or other reasons."""
    if not _is_duplicate(session_id, measurement, measure):
        raise BadFrame(
            f"Step {measurement.number} is stored with other content. A source that starts over "
            f"takes a new run and counts from {next_number}.",
            "conflict",
        )


def _is_duplicate(session_id: int, measurement: Measurement, measure: Measure) -> bool:
    measurement = select_value(measurement, measure)
    stored = Step.everywhere.get(session_id=session_id, number=measurement.number)
    same = (
        stored.time_s == measurement.time_s
        and stored.side == measurement.side
        and stored.value == measurement.value
        and _are_same(stored.extra, measurement.extra)
    )
    if not same or not stored.reasons:
        return same and not measurement.reasons
    return tuple(stored.reasons) == _find_reasons(session_id, measurement, measure, stored)


def _are_same(stored: Mapping[str, float], sent: Mapping[str, float]) -> bool:
    """Return whether these are the values that were sent."""
    return stored.keys() == sent.keys() and all(
        _is_same(stored[name], value) for name, value in sent.items()
    )


def _is_same(stored: Any, sent: Any) -> bool:
    """Return whether a column has the number that was sent.

    PostgreSQL gives a decimal back as a whole number, rounded to the digits that a float has.
    """
    return bool((float(stored) if isinstance(sent, float) else stored) == sent)


def _find_reasons(
    session_id: int, measurement: Measurement, measure: Measure, stored: Step
) -> tuple[str, ...]:
    """Return the reasons that a measurement is stored with: the source's, then the fold's."""
    reasons, number = find_invalid_reasons(measurement, measure), measurement.number
    earlier = Step.everywhere.filter(session_id=session_id, number__lt=number).order_by("-number")
    if stored.rules_version > 1:
        earlier = earlier.filter(side=measurement.side)
    before = earlier.first()
    if before is not None and measurement.time_s < before.time_s:
        reasons = add_reason(reasons, InvalidReason.TIME_BACKWARDS)
    moving = [
        *(kind for kind, one in CONTROLS.items() if one.leads_to in (State.RUNNING, State.PAUSED)),
        *RULE_PAUSES.values(),
    ]
    moves = SessionEvent.everywhere.filter(
        session_id=session_id, after_number__lt=number, kind__in=moving
    )
    last = moves.order_by("-pk").values_list("kind", flat=True).first()
    if last in (ChangeKind.PAUSE, *RULE_PAUSES.values()):
        reasons = add_reason(reasons, InvalidReason.PAUSED)
    return reasons
