"""What a patient sees after a session: how it compares with the earlier ones, and with others."""

from __future__ import annotations

from datetime import datetime

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext_lazy as _
from django.utils.translation import pgettext
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_POST, require_safe

from rehab.boards.ranking import By, Entry, cut, rank, ranking_of, read_figures
from rehab.boards.rows import Row, date_rows, share
from rehab.boards.showing import Shown, show_after, show_waiting
from rehab.people.access import actor_of, for_roles
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import withdraw_consent
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.web.language import activate_patient_language
from rehab.sessions.formatting import NBSP, clinic_time, format_number
from rehab.sessions.models import TrainingSession
from rehab.training.changes import OPEN_STATES, State

SHOWN_S = 20  # a board on a tablet that waits, before the next one
TITLES = {
    By.POINTS: _("Your points"),
    By.KEPT: _("Points you kept"),
    By.RATE: _("Your steps at the goal"),
}


@for_roles(Role.LEAD, Role.PT, tablets=True)
@never_cache
@require_safe
def show_scores(request: HttpRequest, session_id: int) -> HttpResponse:
    """Show the patient's own sessions, the one at hand marked, and the boards that were built.

    A session that still runs has no place. In a blinded study there is nothing to compare.
    """
    session = find_session(request, session_id)
    activate_patient_language(session.patient)
    if State(session.state) in OPEN_STATES:
        return redirect("walk", session_id=session.pk)
    boards: list[Shown] = []
    if not session.patient.blinded:
        now = timezone.now()
        boards = [*show_after(session, now), *own_boards(request, session, now)]
    context = {
        "session": session,
        "boards": boards,
        "tablet": not request.user.is_authenticated,
        "ranked": not boards or any(board.has_you for board in boards),
    }
    return render(request, "boards/scores.html", context)


@for_roles(Role.LEAD, Role.PT, tablets=True)
@require_POST
def leave_boards(request: HttpRequest, session_id: int) -> HttpResponse:
    """Take the session's patient off all boards, at once. Only a therapist brings one back."""
    session = find_session(request, session_id)
    by = request.user if isinstance(request.user, User) else None
    withdraw_consent(session.patient, Purpose.BOARDS, by, timezone.now())
    return redirect("scores", session_id=session.pk)


@for_roles(Role.LEAD, Role.PT, tablets=True)
@never_cache
@require_safe
def show_waiting_board(request: HttpRequest) -> HttpResponse:
    """Show a board of the clinic on a tablet that waits, each in its turn; nothing without one."""
    now = timezone.now()
    boards = show_waiting(actor_of(request).clinic, now)
    if not boards:
        return HttpResponse(status=204)
    turn = int(now.timestamp() // SHOWN_S) % len(boards)
    return render(request, "boards/waiting.html", {"board": boards[turn]})


def find_session(request: HttpRequest, session_id: int) -> TrainingSession:
    """Give a session that whoever asks may see. Raises Http404 for any other."""
    sessions = TrainingSession.objects.visible_to(actor_of(request))
    return get_object_or_404(sessions.select_related("patient", "clinic"), pk=session_id)


def own_boards(request: HttpRequest, session: TrainingSession, now: datetime) -> list[Shown]:
    """Give the boards that are always there: own sessions of this type, and of all types.

    A session whose type was changed on its way is of no type, and stands on the second alone.
    """
    actor = actor_of(request)
    valence = session.to_plan().valence
    figures = read_figures(actor, session)
    places: dict[tuple[str, str, By], list[Entry]] = {}
    if not session.changed_to:
        same = [own for own in figures if own.valence == session.valence and not own.mixed]
        by = ranking_of(valence)
        ranked = rank(same, by, -(valence.miss_points or 0))
        places["same", pgettext("board", "This type"), by] = ranked
    places["all", pgettext("board", "All types"), By.RATE] = rank(figures, By.RATE)
    here = clinic_time(now, session.clinic)
    shown = {key: cut(entries, session.pk) for key, entries in places.items()}
    wanted = {entry.session_id for entries in shown.values() for entry in entries}
    facts = {
        row.pk: row
        for row in TrainingSession.objects.visible_to(actor)
        .filter(pk__in=wanted)
        .only("created_at", "started_at", "active_s")
        .order_by()  # by key; the model's own order would lead through the clinic's other rows
    }
    return [
        Shown(
            slug=slug,
            title=str(TITLES[kind]),
            label=label,
            rows=date_rows(write_rows(entries, kind), facts, session, here),
            kept=kind is By.KEPT,
        )
        for (slug, label, kind), entries in shown.items()
    ]


def write_rows(entries: list[Entry], by: By) -> list[Row]:
    """Put places into words."""
    full = 100 if by is By.RATE else max([1, *(entry.value for entry in entries)])
    rows: list[Row] = []
    expected = 1
    for entry in entries:
        rows.append(
            Row(
                session_id=entry.session_id,
                rank=None if by is By.KEPT else entry.rank,
                value=format_number(entry.value, 0) + (f"{NBSP}%" if by is By.RATE else ""),
                stake="" if entry.stake is None else format_number(entry.stake, 0),
                bar=share(entry.value, entry.stake or full if by is By.KEPT else full),
                skips=entry.place != expected,
            )
        )
        expected = entry.place + 1
    return rows
