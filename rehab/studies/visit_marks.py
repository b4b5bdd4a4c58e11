"""What a study's pages tell beside a visit: simulated, ended early, changed, on another day."""

from __future__ import annotations

from collections.abc import Iterable

from django.db.models import F
from django.utils.translation import gettext

from rehab.sessions.alarms import UNASKED
from rehab.sessions.log import SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.studies.models import Study
from rehab.studies.participants import StudyVisit
from rehab.studies.results.harms_and_deviations import (
    DEVIATIONS,
    ENDED_EARLY,
    EXCLUDED,
    UNWALKED,
    find_days_off,
    label_of,
)
from rehab.training.changes import ChangeKind, State


def describe_visits(
    study: Study, visits: Iterable[StudyVisit], *, blind: bool
) -> dict[int, list[str]]:
    """Return what is remarkable of each visit that was walked, by its key.

    Parameters
    ----------
    study, visits
        The study; all attempts of some of its participants, in their order, each with its session.
    blind
        Whether to hide what was changed, which could tell the arm.
    """
    visits = list(visits)
    days_off = find_days_off(study, visits)
    walked = {visit.session: visit for visit in visits if visit.session is not None}
    window = study.window_days or 0
    unwalked, changed = _unwalked(walked), {} if blind else _changed(walked)
    return {
        visit.pk: [
            *([gettext("simulated")] if visit.is_simulated else ()),
            *([label_of(ENDED_EARLY)] if session.state == State.ABORTED else ()),
            *([label_of(UNWALKED)] if session.pk in unwalked else ()),
            *([label_of(EXCLUDED)] if session.excluded else ()),
            *changed.get(session.pk, ()),
            *(
                [gettext("outside the planned days (%(days)+d)") % {"days": off}]
                if abs(off := days_off[visit.pk]) > window
                else ()
            ),
        ]
        for session, visit in walked.items()
    }


def _unwalked(sessions: Iterable[TrainingSession]) -> set[int]:
    """Return the keys of those that were finished before their last phase."""
    finished = [one.pk for one in sessions if one.state == State.FINISHED]
    last = Step.everywhere.filter(session__in=finished, number=F("session__last_number"))
    reached = dict(last.values_list("session_id", "phase"))
    rows = TrainingSession.everywhere.filter(pk__in=finished)
    planned = rows.order_by().values_list("pk", "plan__phases")
    return {pk for pk, phases in planned if reached.get(pk, -1) + 1 < len(phases)}


def _changed(sessions: Iterable[TrainingSession]) -> dict[int, list[str]]:
    """Return in words what was changed against the plan, by the session's key."""
    keys = [one.pk for one in sessions]
    events = SessionEvent.everywhere.filter(session__in=keys, kind__in=DEVIATIONS)
    found: dict[int, list[str]] = {}
    events = events.exclude(data__has_key=UNASKED).order_by("kind")
    for pk, kind in events.values_list("session_id", "kind").distinct():
        label = label_of(kind)
        is_change = kind in list(ChangeKind)
        told = gettext("changed: %(what)s") % {"what": label} if is_change else label
        found.setdefault(pk, []).append(told)
    return found
