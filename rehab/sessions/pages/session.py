"""The page of one session, and the form that corrects it."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.text import capfirst
from django.utils.translation import gettext
from django.views.decorators.http import require_http_methods, require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.models import User
from rehab.people.roles import Role, may_see_names
from rehab.sessions.corrections import CorrectedField, can_correct, describe_corrections
from rehab.sessions.formatting import (
    MISSING,
    clinic_time,
    format_day,
    format_rate,
    format_state,
)
from rehab.sessions.forms.correction import CorrectionForm
from rehab.sessions.models import TrainingSession
from rehab.sessions.questionnaires import questionnaire_choices
from rehab.sessions.reports.answers import list_answers
from rehab.sessions.reports.remarks import read_noted
from rehab.sessions.reports.review import review_session
from rehab.sessions.reports.summary import (
    format_incidents,
    format_mean,
    format_phases,
    format_summary,
    load_point,
)
from rehab.sessions.reports.text_note import write_text_note
from rehab.sessions.reports.trend import with_metrics
from rehab.sessions.robot_incidents import RobotIncident
from rehab.training.changes import OPEN_STATES, State
from robot.wire.incident import MOTION


@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
@require_safe
def show_session(request: HttpRequest, session_id: int) -> HttpResponse:
    """Show one session with every stride, phase and event; researchers see a pseudonym."""
    user = user_of(request)
    session = get_object_or_404(
        TrainingSession.objects.visible_to(user).select_related("patient", "clinic", "measure"),
        pk=session_id,
    )
    review = review_session(user, session)
    summary, point = format_summary(session.to_plan(), review), load_point(user, session)
    mean = format_mean(session, point)
    corrections = describe_corrections(session, user)
    notes = (entry.new for entry in corrections if entry.row.field == CorrectedField.NOTE)
    note = next(notes, "")
    whether = (
        entry.row.reason for entry in corrections if entry.row.field == CorrectedField.COUNTS
    )
    by_name = may_see_names(user.role)
    start = clinic_time(session.began_at, session.clinic)
    now = clinic_time(timezone.now(), session.clinic)
    noted = read_noted(review.rows)
    context = {
        "session": session,
        "noted": dict.fromkeys(one.words for one in noted if one.is_adverse),
        "by_name": by_name,
        "who": session.patient.nickname if by_name else session.patient.pseudonym,
        "day": capfirst(format_day(start.date(), now.date())),
        "time": f"{start:%H:%M}",
        "state": format_state(session.state),
        "open": State(session.state) in OPEN_STATES,
        "can_correct": by_name and can_correct(session),
        "corrections": corrections,
        "note": note,
        "why_left_out": next(whether, ""),
        "text": write_text_note(user, session, review, note) if by_name else "",
        "review": review,
        "incidents": _list_incidents(user, session) if by_name else [],
        "figures": [summary.hit_rate, *([mean] if mean.value != MISSING or mean.note else [])],
        "facts": [
            (summary.goal, " "),
            (summary.duration, ", "),
            (summary.strides, ", "),
            (summary.score, " "),
        ],
        "alarms": format_incidents(review, session),
        "phases": format_phases(review),
        "asked": list_answers(user, session),
        "questionnaires": questionnaire_choices(session.clinic_id) if by_name else (),
    }
    return render(request, "sessions/session.html", context)


def _list_incidents(user: User, session: TrainingSession) -> list[tuple[RobotIncident, datetime]]:
    """Return the incidents of a session's robot, without recordings, with their local times."""
    rows = RobotIncident.objects.visible_to(user).filter(session=session).defer("recording")
    rows = rows.exclude(reason=MOTION)
    return [(row, clinic_time(row.at, session.clinic)) for row in rows.order_by("pk")]


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def correct(request: HttpRequest, session_id: int) -> HttpResponse:
    """Correct an ended session: who walked, whether it counts, a note. The log stays as it is."""
    user = user_of(request)
    rows = with_metrics(user, TrainingSession.objects.visible_to(user))
    session: Any = get_object_or_404(rows.select_related("patient", "clinic"), pk=session_id)
    if not can_correct(session):
        messages.error(
            request, gettext("This session is still running. End it before you correct it.")
        )
        return redirect("session", session_id=session.pk)
    form = CorrectionForm(request.POST or None, session=session, by=user)
    if request.method == "POST" and form.create(timezone.now()):
        messages.success(request, gettext("Corrected. Figures, boards and trends follow it."))
        return redirect("session", session_id=session.pk)
    context = {"session": session, "form": form, "rate": format_rate(session.metric_hit_rate)}
    return render(request, "sessions/correct.html", context)
