"""The questions after a session: answered by the patient, one on a page, in large print."""

from __future__ import annotations

from typing import Any

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST

from rehab.people.access import actor_of, for_roles, user_of
from rehab.people.roles import Role
from rehab.people.web.language import activate_patient_language
from rehab.people.web.refusals import format_refusal
from rehab.sessions.models import TrainingSession
from rehab.sessions.questionnaires import (
    QuestionnaireResponse,
    answer,
    ask,
    next_response,
    questionnaire_choices,
    stop,
)
from rehab.training.measures import InvalidSetting


def page_after(session: TrainingSession, actor: Any, *, tablet: bool) -> str:
    """Return where a patient goes on after a session: open questions, then the scores."""
    if next_response(actor, session) is not None:
        return reverse("questions", args=[session.pk])
    if not session.patient.blinded:
        return reverse("scores", args=[session.pk])
    return reverse("tablet") if tablet else reverse("patient", args=[session.patient_id])


def _get_session(actor: Any, session_id: int) -> TrainingSession:
    sessions = TrainingSession.objects.visible_to(actor).select_related("patient", "clinic")
    return get_object_or_404(sessions, pk=session_id)


@for_roles(Role.LEAD, Role.PT, tablets=True)
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def ask_questions(request: HttpRequest, session_id: int) -> HttpResponse:
    """Show the next question and store its answer; without one, go on after the session.

    ``?back=2`` shows the second question again, with what was answered.
    """
    actor = actor_of(request)
    session = _get_session(actor, session_id)
    activate_patient_language(session.patient)
    response = next_response(actor, session)
    tablet = not request.user.is_authenticated
    if response is None:
        return redirect(page_after(session, actor, tablet=tablet))
    problem = ""
    if request.method == "POST":
        try:
            _store(request, response)
        except InvalidSetting as refused:
            problem = format_refusal(refused)
        else:
            return redirect("questions", session_id=session.pk)
    context = _describe(response, request.GET.get("back", ""))
    context |= {"session": session, "tablet": tablet, "problem": problem}
    return render(request, "sessions/questions.html", context, status=400 if problem else 200)


def _store(request: HttpRequest, response: QuestionnaireResponse) -> None:
    """Store what was tapped. A form of an earlier questionnaire changes nothing."""
    now = timezone.now()
    if request.POST.get("response") != str(response.pk):
        return
    if "stop" in request.POST:
        stop(response, now)
        return
    value = None if "skip" in request.POST else _number(request.POST.get("value", ""))
    answer(response, _number(request.POST.get("number", "")), value, now)


def _number(text: str) -> int:
    """Return a small whole number; −1, which no question and no scale has, for any other text."""
    return int(text) if text.isascii() and text.isdecimal() and len(text) < 5 else -1


def _describe(response: QuestionnaireResponse, back: str) -> dict[str, Any]:
    instrument = response.to_instrument()
    reached = len(response.answers)
    number = min(_number(back) - 1, reached) if _number(back) > 0 else reached
    item = instrument.items[number]
    return {
        "response": response,
        "instrument": instrument,
        "item": item,
        "number": number,
        "shown_number": number + 1,
        "count": len(instrument.items),
        "chosen": response.answers[number] if number < reached else None,
        "values": list(item.values),
        "is_fine": item.points > 11,
    }


@for_roles(Role.LEAD, Role.PT)
@require_POST
def add_questionnaire(request: HttpRequest, session_id: int) -> HttpResponse:
    """Plan a questionnaire for a session, also after its end, and go to its first question."""
    user = user_of(request)
    session = _get_session(user, session_id)
    known = dict(questionnaire_choices(session.clinic_id))
    slug = request.POST.get("questionnaire", "")
    if slug not in known:
        return redirect("session", session_id=session.pk)
    ask(session, [slug], timezone.now())
    if next_response(user, session) is None:  # it was answered already
        return redirect("session", session_id=session.pk)
    return redirect("questions", session_id=session.pk)
