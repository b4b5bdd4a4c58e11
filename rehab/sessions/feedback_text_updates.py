"""Applies edited feedback texts to the clinic's open sessions, from their next step on.

Like a start or a pause by the API, the change goes through this process's runtime and is logged
before it takes effect. Points and gestures of a session that has been set up do not change.
"""

from __future__ import annotations

from typing import Any

from asgiref.sync import async_to_sync
from django.utils.translation import gettext as _

from rehab.feedback.clinic_valences import default_valence
from rehab.feedback.models import FeedbackType, feedback_text_edited
from rehab.people.models import User
from rehab.people.web.refusals import format_refusal
from rehab.sessions.live import runtime
from rehab.sessions.live.database.owners import OwnedElsewhere
from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.live.orders import ChangeOrder
from rehab.sessions.models import TrainingSession
from rehab.training.bands import bands_to_json
from rehab.training.changes import OPEN_STATES, ChangeKind
from rehab.training.measures import InvalidSetting
from rehab.training.valences import Valence


def connect_signals() -> None:
    """Connect the signal of edited texts, once, when the process starts."""
    feedback_text_edited.connect(update_open_sessions)


def update_open_sessions(
    row: FeedbackType | None, clinic_id: int, slug: str, by: User, **_signal: Any
) -> list[str]:
    """Update the clinic's open sessions; return messages about those that could not be."""
    open_ones = TrainingSession.everywhere.filter(
        clinic=clinic_id, state__in=[state.value for state in OPEN_STATES]
    )
    problems: list[str] = []
    for session in open_ones.select_related("patient").order_by("pk"):
        language = session.to_plan().language
        valence = row.to_valence(language) if row is not None else default_valence(slug, language)
        try:
            async_to_sync(_update_session)(session.pk, valence, by)
        except (InvalidSetting, OwnedElsewhere, NotStored) as problem:
            problems.append(
                _("The open session of %(patient)s keeps its words: %(problem)s")
                % {"patient": session.patient.nickname, "problem": _describe_problem(problem)}
            )
    return problems


def _describe_problem(problem: Exception) -> str:
    return format_refusal(problem) if isinstance(problem, InvalidSetting) else str(problem)


async def _update_session(session_id: int, valence: Valence, by: User) -> None:
    """Change the texts of one session, unless it has them or has no such valence."""
    in_server = runtime.peek() is not None
    live_runtime = runtime.current()
    try:
        live = await live_runtime.session(session_id)
        known = live.aggregate.fold.valences.known.get(valence.slug)
        if known is None or known.bands == valence.bands:
            return
        value = {"valence": valence.slug, "bands": bands_to_json(valence.bands)}
        order = ChangeOrder(ChangeKind.FEEDBACK_TEXT, value, by)
        await live_runtime.order(session_id, order)
    finally:
        if not in_server:
            await live_runtime.drain()
