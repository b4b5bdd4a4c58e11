"""How a patient walks during a session: belt speed, body-weight support, what helps.

A therapist notes it with one tap, or the treadmill reports it with its strides. It holds from its
mark in the log until the next one of its kind, and changes no score.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from django.utils.translation import gettext

from rehab.people.models import User
from rehab.sessions.formatting import NBSP, format_number
from rehab.sessions.log import ASSISTANCE, EVENTS, REMARK_RANGES, Remark, SessionEvent
from rehab.sessions.models import TrainingSession


class Reported(NamedTuple):
    """What a treadmill reports with a stride: its name there, and what it means to change."""

    name: str
    least_change: float  # less is the belt's own unsteadiness


REPORTED = {
    Remark.BELT_SPEED: Reported("belt_speed_m_s", 0.05),
    Remark.WEIGHT_SUPPORT: Reported("weight_support_percent", 2.5),
}
MEASURED = tuple(REPORTED)
CONDITIONS = (*MEASURED, *ASSISTANCE)
RATED = (Remark.BORG, Remark.PAIN)  # by the patient, 0 to 10
USUAL_FROM = 0.5  # share of the steps from which a session counts as walked with an aid


def planned_conditions(session: TrainingSession) -> dict[str, float]:
    """Return what the set-up says, by kind; without what it leaves open."""
    planned = {
        Remark.BELT_SPEED.value: session.belt_speed_m_s,
        Remark.WEIGHT_SUPPORT.value: session.weight_support_percent,
    }
    return {kind: value for kind, value in planned.items() if value is not None}


def find_reported(
    now: Mapping[str, float], extra: Mapping[str, float]
) -> list[tuple[Remark, float]]:
    """Return what a stride's further values change of the conditions that hold ``now``.

    A value that no treadmill or harness has is none.
    """
    changed = []
    for kind, (name, least_change) in REPORTED.items():
        value, (lowest, highest) = extra.get(name), REMARK_RANGES[kind]
        if value is None or not lowest <= value <= highest:
            continue
        before = now.get(kind)
        if before is None or abs(value - before) >= least_change:
            changed.append((kind, round(value, 2)))
    return changed


def summarize_conditions(
    session: TrainingSession, events: Iterable[SessionEvent]
) -> dict[str, float]:
    """Return a session's conditions by kind, weighted by the steps that they held for.

    Of speed and support the mean, of an aid the share of the steps with it, of exertion and pain
    the highest. What was neither planned nor noted is missing.

    Parameters
    ----------
    session
        With ``last_number``, the end of its log.
    events
        Of the log, in its order; others than conditions and ratings are skipped.
    """
    marks: defaultdict[str, list[tuple[int, float]]] = defaultdict(list)
    for kind, value in planned_conditions(session).items():
        marks[kind].append((0, value))
    highest: dict[str, float] = {}
    for event in events:
        kind, noted = event.kind, event.value
        if noted is None:
            continue
        if kind in RATED:
            highest[kind] = max(noted, highest.get(kind, noted))
        elif kind in CONDITIONS:
            if kind in ASSISTANCE and not marks[kind]:
                marks[kind].append((0, 0.0))  # until now without it
            marks[kind].append((event.after_number, noted))
    means = {kind: _mean_over_steps(held, session.last_number) for kind, held in marks.items()}
    return {kind: mean for kind, mean in means.items() if mean is not None} | highest


def _mean_over_steps(marks: list[tuple[int, float]], last: int) -> float | None:
    """Return the mean of values that each hold from a step on; before the first nothing does."""
    ends = [after for after, _value in marks[1:]] + [last]
    spans = [(max(0, end - after), value) for (after, value), end in zip(marks, ends, strict=True)]
    steps = sum(count for count, _value in spans)
    if not steps:
        return marks[-1][1] if marks else None
    return sum(count * value for count, value in spans) / steps


def load_conditions(user: User, sessions: Iterable[TrainingSession]) -> dict[int, dict[str, float]]:
    """Return `summarize_conditions` of sessions, by their keys."""
    by_key = {session.pk: session for session in sessions}
    kinds = [kind.value for kind in (*CONDITIONS, *RATED)]
    rows = SessionEvent.objects.visible_to(user).filter(session__in=list(by_key), kind__in=kinds)
    found: defaultdict[int, list[SessionEvent]] = defaultdict(list)
    for event in rows.order_by("pk").defer("data"):
        found[event.session_id].append(event)
    return {key: summarize_conditions(one, found[key]) for key, one in by_key.items()}


def format_noted(kind: str, value: float | None) -> str:
    """Return the value of a remark as text; empty for one without."""
    if value is None or kind not in REMARK_RANGES:
        return ""
    if kind in ASSISTANCE:
        return gettext("from here on") if value else gettext("no longer")
    if kind == Remark.BELT_SPEED:
        return f"{format_number(value)}{NBSP}m/s"
    whole = format_number(value, 0)
    if kind in RATED:
        return gettext("%(number)s of %(count)s") % {"number": whole, "count": 10}
    return f"{whole}{NBSP}%" if kind == Remark.WEIGHT_SUPPORT else whole


def name_assistance(conditions: Mapping[str, float]) -> str:
    """Return what helped for at least half of the steps, as text."""
    usual = [kind for kind in ASSISTANCE if conditions.get(kind, 0.0) >= USUAL_FROM]
    return ", ".join(str(EVENTS[kind]) for kind in usual)
