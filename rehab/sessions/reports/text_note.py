"""A session as a few lines of text, to be copied into the clinic's own record."""

from __future__ import annotations

import re

from django.utils.text import capfirst
from django.utils.translation import gettext

from rehab.people.models import User
from rehab.people.models.clinics import NOTE_PLACEHOLDERS, PLACEHOLDER
from rehab.sessions.assessment_results import assessments_with
from rehab.sessions.formatting import MISSING, clinic_time
from rehab.sessions.log import EVENTS
from rehab.sessions.models import TrainingSession
from rehab.sessions.noted_conditions import (
    MEASURED,
    format_noted,
    name_assistance,
    summarize_conditions,
)
from rehab.sessions.reports.remarks import Noted, read_noted
from rehab.sessions.reports.review import SessionReview
from rehab.sessions.reports.summary import format_summary


def write_text_note(user: User, session: TrainingSession, review: SessionReview, note: str) -> str:
    """Return the clinic's text of a session, filled in; without lines that stay empty.

    Parameters
    ----------
    user, session
        Who reads it; the session, with its clinic and patient.
    review
        Its figures and events.
    note
        What the therapist wrote.
    """
    template = session.clinic.note_template or usual_template()
    values = _values(user, session, review, note)
    lines = []
    for line in template.splitlines():
        names = PLACEHOLDER.findall(line)
        if names and not any(values.get(name) for name in names):
            continue
        lines.append(re.sub(PLACEHOLDER, lambda found: values.get(found[1]) or MISSING, line))
    return "\n".join(lines)


def usual_template() -> str:
    """Return the template of a clinic that has none of its own, in the page's language."""
    return gettext(
        "Gait training with feedback, {day} {time}, {code}\n"
        "{walked}, {strides} strides, feedback {type}, goal {goal}, {hits} hits\n"
        "Walked with: {conditions}\n"
        "Noted: {noted}\n"
        "Tests: {tests}\n"
        "{note}"
    )


def _values(
    user: User, session: TrainingSession, review: SessionReview, note: str
) -> dict[str, str]:
    figures = format_summary(session.to_plan(), review)
    began = clinic_time(session.began_at, session.clinic)
    noted = [one for one in read_noted(review.rows) if one.is_told]
    values = {
        "day": f"{began:%Y-%m-%d}",
        "time": f"{began:%H:%M}",
        "name": session.patient.nickname,
        "code": session.patient.code,
        "own_goal": session.patient.own_goal,
        "walked": figures.duration.value,
        "strides": figures.strides.value,
        "hits": figures.hit_rate.value,
        "score": figures.score.value,
        "goal": f"{figures.goal.value} {figures.goal.note}",
        "type": session.valences_label,
        "conditions": _describe_conditions(session, review),
        "noted": "; ".join(_describe(one, session) for one in noted),
        "tests": "; ".join(str(row) for row in assessments_with(user, session)),
        "note": note,
    }
    return {name: values[name] for name in NOTE_PLACEHOLDERS}


def _describe(noted: Noted, session: TrainingSession) -> str:
    return f"{capfirst(noted.words)} ({clinic_time(noted.at, session.clinic):%H:%M})"


def _describe_conditions(session: TrainingSession, review: SessionReview) -> str:
    conditions = summarize_conditions(session, review.rows)
    measured = [
        f"{EVENTS[kind]} {format_noted(kind, conditions[kind])}"
        for kind in MEASURED
        if kind in conditions
    ]
    return ", ".join(filter(None, [session.device, *measured, name_assistance(conditions)]))
