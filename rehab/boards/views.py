"""Pages of scores: a session compared with earlier ones and other patients; waiting boards."""

from __future__ import annotations

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_POST, require_safe

from rehab.boards.panels.own_sessions_panel import make_own_panel
from rehab.boards.panels.panel_rows import BoardPanel
from rehab.boards.panels.shared_panels import make_session_panels, make_waiting_panels
from rehab.people.access import actor_of, for_roles
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import withdraw_consent
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.web.language import activate_patient_language
from rehab.sessions.formatting import format_duration, format_number
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.earned_number import label_steps
from rehab.stations.tablets import SCORES_STAY_S
from rehab.training.changes import OPEN_STATES, State

ROTATION_S = 20  # for which a waiting tablet shows each board


@for_roles(Role.LEAD, Role.PT, tablets=True)
@never_cache
@require_safe
def show_scores(request: HttpRequest, session_id: int) -> HttpResponse:
    """Show the boards of the clinic, and the own sessions with the one at hand marked.

    Redirects to the patient's page of an open session. Shows no boards in a blinded study.
    """
    session = find_session(request, session_id)
    activate_patient_language(session.patient)
    if State(session.state) in OPEN_STATES:
        return redirect("walk", session_id=session.pk)
    boards: list[BoardPanel] = []
    if not session.patient.blinded:
        now = timezone.now()
        boards = [*make_session_panels(session, now), make_own_panel(session, now)]
    context = {
        "session": session,
        "boards": boards,
        "tablet": not request.user.is_authenticated,
        "stays_s": SCORES_STAY_S,
        "early": State(session.state) is State.ABORTED,
        "ranked": not boards or any(board.has_you for board in boards),
    }
    if not context["ranked"]:
        steps = session.steps.filter(valid=True, side=session.trained_side).count()
        context["walked"] = format_duration(session.active_s)
        context["steps"] = steps and f"{format_number(steps, 0)} {label_steps(session, steps)}"
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
    """Show a board of the clinic on a waiting tablet, each in turn; 204 where there is none, and
    outside the clinic's networks."""
    now, actor = timezone.now(), actor_of(request)
    is_away = not isinstance(actor, User) and actor.is_away  # who is on a board said nothing of it
    boards = [] if is_away else make_waiting_panels(actor.clinic, now)
    if not boards:
        return HttpResponse(status=204)
    turn = int(now.timestamp() // ROTATION_S) % len(boards)
    return render(request, "boards/waiting.html", {"board": boards[turn]})


def find_session(request: HttpRequest, session_id: int) -> TrainingSession:
    """Return a session that the caller may see. Raises Http404 for any other."""
    sessions = TrainingSession.objects.visible_to(actor_of(request))
    return get_object_or_404(sessions.select_related("patient", "clinic"), pk=session_id)
