"""Brings words that a clinic edited to its open sessions, from their next step on.

The same way as a start or a pause by the API: through this process's runtime, into the log first.
Points and gestures of a session that has been set up stay as they are.
"""

from __future__ import annotations

from typing import Any

from asgiref.sync import async_to_sync
from django.utils.translation import gettext as _

from rehab.feedback.clinic_valences import default_valence
from rehab.feedback.models import FeedbackType, feedback_text_edited
from rehab.people.models import User
from rehab.people.web.refusals import in_words
from rehab.sessions.live import runtime
from rehab.sessions.live.owners import OwnedElsewhere
from rehab.sessions.live.session import NotStored
from rehab.sessions.models import TrainingSession
from rehab.training.changes import OPEN_STATES, ChangeKind
from rehab.training.measures import InvalidSetting
from rehab.training.valences import Valence, bands_to_json


def listen() -> None:
    """Listen, from the start of the process on."""
    feedback_text_edited.connect(on_words_edited)


def on_words_edited(
    row: FeedbackType | None, clinic_id: int, slug: str, by: User, **_signal: Any
) -> list[str]:
    """Reword the clinic's open sessions; give what could not be reached, in words."""
    open_ones = TrainingSession.everywhere.filter(
        clinic=clinic_id, state__in=[state.value for state in OPEN_STATES]
    )
    problems: list[str] = []
    for session in open_ones.select_related("patient").order_by("pk"):
        language = session.to_plan().language
        worded = row.to_valence(language) if row is not None else default_valence(slug, language)
        try:
            async_to_sync(_reword)(session.pk, worded, by)
        except (InvalidSetting, OwnedElsewhere, NotStored) as problem:
            problems.append(
                _("The open session of %(patient)s keeps its words: %(problem)s")
                % {"patient": session.patient.nickname, "problem": _say(problem)}
            )
    return problems


def _say(problem: Exception) -> str:
    return in_words(problem) if isinstance(problem, InvalidSetting) else str(problem)


async def _reword(session_id: int, worded: Valence, by: User) -> None:
    """Change the words of one session, unless it has them or cannot come to that type."""
    serves = runtime.peek() is not None
    here = runtime.current()
    try:
        live = await here.session(session_id)
        known = live.actor.fold.valences.get(worded.slug)
        if known is None or known.bands == worded.bands:
            return
        value = {"valence": worded.slug, "bands": bands_to_json(worded.bands)}
        await here.change(session_id, ChangeKind.FEEDBACK_TEXT, value, by)
    finally:
        if not serves:
            await here.drain()
