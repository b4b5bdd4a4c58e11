"""Applies edited texts, and a patient's other language, to open sessions from their next step on.

Like a start or a pause by the API, the change goes through this process's runtime and is logged
before it takes effect. Points and gestures of a session that has been set up do not change.
"""

from __future__ import annotations

from typing import Any

from asgiref.sync import async_to_sync
from django.db.models import QuerySet
from django.utils.translation import gettext as _

from rehab.feedback.clinic_valences import default_valence, valences_of
from rehab.feedback.models import FeedbackType, feedback_text_edited
from rehab.people.models import Patient, User
from rehab.people.web.refusals import format_refusal
from rehab.sessions.live import runtime
from rehab.sessions.live.database.clinic_owners import OwnedElsewhere
from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.live.orders import ChangeOrder
from rehab.sessions.models import TrainingSession
from rehab.training.changes import OPEN_STATES, ChangeKind
from rehab.training.feedback_bands import bands_to_json
from rehab.training.measures import InvalidSetting
from rehab.training.valences import Valence


def connect_signals() -> None:
    """Connect the signal of edited texts, once, when the process starts."""
    feedback_text_edited.connect(update_open_sessions)


def update_open_sessions(
    row: FeedbackType | None, clinic_id: int, slug: str, by: User, **_signal: Any
) -> list[str]:
    """Update the clinic's open sessions; return messages about those that could not be."""
    problems: list[str] = []
    for session in _open_sessions(clinic=clinic_id):
        language = session_language(session)
        valence = row.to_valence(language) if row is not None else default_valence(slug, language)
        problems += _update(session, [valence], by)
    return problems


def change_language(patient: Patient, by: User) -> list[str]:
    """Let a patient's open sessions go on in the patient's language; return what could not be."""
    valences = valences_of(patient.clinic_id, patient.language)
    problems: list[str] = []
    for session in _open_sessions(patient=patient):
        problems += _update(session, list(valences.values()), by, patient.language)
    return problems


def session_language(session: TrainingSession) -> str:
    """Return the language that a session's words are in now."""
    edits = session.events.filter(kind=ChangeKind.FEEDBACK_TEXT.value).order_by("-pk")
    values = (data.get("value", {}) for data in edits.values_list("data", flat=True))
    changed = (value["language"] for value in values if "language" in value)
    return next(changed, session.to_plan().language)


def _open_sessions(**which: Any) -> QuerySet[TrainingSession]:
    open_states = [state.value for state in OPEN_STATES]
    rows = TrainingSession.everywhere.filter(state__in=open_states, **which)
    return rows.select_related("patient").order_by("pk")


def _update(
    session: TrainingSession, valences: list[Valence], by: User, language: str = ""
) -> list[str]:
    try:
        async_to_sync(_update_session)(session.pk, valences, by, language)
    except (InvalidSetting, OwnedElsewhere, NotStored) as problem:
        words = _("The open session of %(patient)s keeps its words: %(problem)s")
        about = {"patient": session.patient.nickname, "problem": _describe_problem(problem)}
        return [words % about]
    return []


def _describe_problem(problem: Exception) -> str:
    return format_refusal(problem) if isinstance(problem, InvalidSetting) else str(problem)


async def _update_session(
    session_id: int, valences: list[Valence], by: User, language: str
) -> None:
    """Change the texts of one session, unless it has them or has no such valence."""
    in_server = runtime.peek() is not None
    live_runtime = runtime.current()
    try:
        live = await live_runtime.session(session_id)
        course = live.aggregate.fold.valences
        for valence in valences:
            known = course.known.get(valence.slug)
            speaks = language or course.language
            if known is None or (known.bands == valence.bands and speaks == course.language):
                continue
            value = {"valence": valence.slug, "bands": bands_to_json(valence.bands)}
            if language:
                value["language"] = language
            await live_runtime.order(session_id, ChangeOrder(ChangeKind.FEEDBACK_TEXT, value, by))
    finally:
        if not in_server:
            await live_runtime.drain()
