"""What a patient sees after a session: how it compares with the earlier ones."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from datetime import datetime

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.http import require_safe

from rehab.boards.ranking import By, Entry, cut, rank, ranking_of, read_figures
from rehab.people.access import actor_of, for_roles
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from rehab.sessions.words import at_clinic, say_day, say_duration, say_number
from rehab.training.changes import OPEN, State

TITLES = {
    By.POINTS: "Your points",
    By.KEPT: "Points you kept",
    By.RATE: "Your steps at the goal",
}


@dataclass(frozen=True)
class Row:
    """A session on the page. ``bar`` is in percent; ``skips``: rows before it are left out."""

    session_id: int
    rank: int
    value: str
    stake: int | None
    bar: int
    day: str
    detail: str
    you: bool
    skips: bool


@dataclass(frozen=True)
class Board:
    """One tab of the page."""

    slug: str
    label: str
    by: By
    rows: list[Row]

    @property
    def title(self) -> str:
        """What the figures are."""
        return TITLES[self.by]


@for_roles(Role.LEAD, Role.PT, tablets=True)
@require_safe
def show_scores(request: HttpRequest, session_id: int) -> HttpResponse:
    """Show the patient's own sessions, the one at hand marked. One that still runs has no place."""
    actor = actor_of(request)
    session = get_object_or_404(
        TrainingSession.objects.visible_to(actor).select_related("patient", "clinic"), pk=session_id
    )
    if State(session.state) in OPEN:
        return redirect("walk", session_id=session.pk)
    valence = session.to_plan().valence
    figures = read_figures(actor, session)
    same = [own for own in figures if own.valence == session.valence]
    by = ranking_of(valence)
    places = {
        ("same", "This type", by): rank(same, by, -(valence.miss_points or 0)),
        ("all", "All types", By.RATE): rank(figures, By.RATE),
    }
    shown = {key: cut(entries, session.pk) for key, entries in places.items()}
    wanted = {entry.session_id for entries in shown.values() for entry in entries}
    facts = {
        row.pk: row
        for row in TrainingSession.objects.visible_to(actor)
        .filter(pk__in=wanted)
        .only("created_at", "started_at", "active_s")
        .order_by()  # by key; the model's own order would lead through the clinic's other rows
    }
    boards = [
        Board(slug, label, kind, write_rows(entries, facts, session, kind))
        for (slug, label, kind), entries in shown.items()
    ]
    context = {
        "session": session,
        "boards": boards,
        "tablet": not request.user.is_authenticated,
        "ranked": any(own.session_id == session.pk for own in figures),
    }
    return render(request, "boards/scores.html", context)


def write_rows(
    entries: list[Entry], facts: dict[int, TrainingSession], session: TrainingSession, by: By
) -> list[Row]:
    """Put places into words, each with its day and how long was walked."""
    began = {
        pk: at_clinic(row.started_at or row.created_at, session.clinic) for pk, row in facts.items()
    }
    a_day = Counter(began[entry.session_id].date() for entry in entries)
    today = at_clinic(timezone.now(), session.clinic).date()
    full = 100 if by is By.RATE else max([1, *(entry.value for entry in entries)])
    rows: list[Row] = []
    expected = 1
    for entry in entries:
        start = began[entry.session_id]
        walked = say_duration(facts[entry.session_id].active_s)
        scale = entry.stake or full if by is By.KEPT else full
        rows.append(
            Row(
                session_id=entry.session_id,
                rank=entry.rank,
                value=say_number(entry.value, 0) + ("\N{NO-BREAK SPACE}%" if by is By.RATE else ""),
                stake=entry.stake,
                bar=max(0, round(100 * entry.value / scale)),
                day=say_day(start.date(), today),
                detail=f"{say_time(start)} · {walked}" if a_day[start.date()] > 1 else walked,
                you=entry.session_id == session.pk,
                skips=entry.place != expected,
            )
        )
        expected = entry.place + 1
    return rows


def say_time(moment: datetime) -> str:
    """Write the time of day."""
    return f"{moment:%H:%M}"
