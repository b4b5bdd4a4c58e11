"""What patients answered after a session, as text."""

from __future__ import annotations

from typing import Any

from django.utils.translation import gettext as _

from rehab.people.models import User
from rehab.questionnaires.instrument import Scoring
from rehab.sessions.formatting import MISSING, format_number
from rehab.sessions.models import TrainingSession
from rehab.sessions.questionnaires import QuestionnaireResponse

MAX_ON_PAPER = 6  # questions of a clinic's own that have room on a page of paper


def list_answers(user: User, session: TrainingSession) -> list[dict[str, Any]]:
    """Return each questionnaire of a session: its sum, and every question with its answer."""
    rows = QuestionnaireResponse.objects.visible_to(user).filter(session=session).order_by("pk")
    return [_describe(row) for row in rows]


def _describe(row: QuestionnaireResponse) -> dict[str, Any]:
    instrument, score = row.to_instrument(), row.score
    items = [
        {
            "text": item.text,
            "answer": MISSING
            if answer is None
            else _("%(answer)s (%(first)s to %(last)s)")
            % {"answer": answer, "first": item.values[0], "last": item.values[-1]},
        }
        for item, answer in zip(instrument.items, row.all_answers, strict=True)
    ]
    given = sum(answer is not None for answer in row.answers)
    if score is not None:
        total = _("%(score)s of 100") % {"score": format_number(score, 1)}
    else:
        total = _("%(given)s of %(count)s answered") % {"given": given, "count": len(items)}
    return {
        "title": instrument.title,
        "total": total,
        "items": items,
        "on_paper": items[:MAX_ON_PAPER] if instrument.scoring is Scoring.NONE else [],
        "is_open": row.finished_at is None,
        "source": instrument.source,
        "license": instrument.license,
        "unvalidated": bool(instrument.license) and not instrument.validated,
    }
