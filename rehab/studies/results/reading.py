"""A study's participants, read from the logs of their sessions: once, until something changes.

The log of a session that has ended stays as it is. So a participant is read again only where a row
differs that decides which sessions count; the process caches what it read of its latest studies.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date, datetime
from functools import cached_property
from threading import Lock
from typing import Any

from django.db.models import Count, F, Max, Q, Sum

from rehab.sessions.assessment_results import Assessment
from rehab.sessions.formatting import clinic_time
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.log_fold import fold_log
from rehab.sessions.models import TrainingSession
from rehab.sessions.questionnaires import QuestionnaireResponse
from rehab.studies.analysis.clinical_outcomes import (
    AFTER,
    FOLLOW_UP,
    ClinicalResult,
    Day,
    clinical_baselines,
    clinical_changes,
)
from rehab.studies.analysis.curves import Point
from rehab.studies.analysis.findings import Departure, OutcomeResult, find
from rehab.studies.analysis.participants import (
    AnalyzedSession,
    Attendance,
    Participant,
    ParticipantVisit,
    curves_by_arm,
    make_participant,
)
from rehab.studies.analysis.walks import COLUMNS, read_walk
from rehab.studies.models import Study, StudyMark
from rehab.studies.participants import Enrollment, StudyVisit, counts_people_alone
from rehab.training.changes import ENDED_STATES, State
from rehab.training.fold import SessionFold
from rehab.training.plans import SessionPlan
from rehab.training.summary.metrics import compute_metrics

CACHED_STUDIES = 8
UNREAD = ("session__plan", "session__checkpoint", "session__legacy_row")  # large, and seldom needed


@dataclass(frozen=True)
class Analysis:
    """What was computed of participants, nothing of it twice."""

    participants: tuple[Participant, ...]
    arms: tuple[str, ...]
    crossover: bool

    @cached_property
    def _findings(self) -> dict[tuple[str, frozenset[Departure]], OutcomeResult]:
        return {}

    def find(self, slug: str, departures: frozenset[Departure]) -> OutcomeResult:
        """Return what was found of an outcome.

        Parameters
        ----------
        slug, departures
            Of the outcome; who departed from the protocol, and at which visit.
        """
        place = slug, departures
        if place not in self._findings:
            self._findings[place] = find(
                *(self.participants, self.arms, slug),
                crossover=self.crossover,
                departures=departures,
            )
        return self._findings[place]

    @cached_property
    def curves(self) -> dict[str, list[Point]]:
        """The mean curve of each arm, by its code."""
        return curves_by_arm(self.participants, self.arms)


@dataclass(frozen=True, slots=True)
class _CachedStudy:
    people: Mapping[int, tuple[Any, Participant]]  # by enrollment: what it was read from
    analysis: Analysis


# By the study's key and its seal, which no other one has, also after a restore.
_cache: OrderedDict[tuple[int, str], _CachedStudy] = OrderedDict()
_lock = Lock()  # requests have threads


def analyze(study: Study, arms: tuple[str, ...], until: date) -> Analysis:
    """Return what a study's participants gave. ``until``: visits up to this day are due."""
    place = study.pk, study.sealed
    known = _cache.get(place)
    people = _read_people(study, until, {} if known is None else known.people)
    analysis = Analysis(tuple(one for _key, one in people.values()), arms, study.crossover)
    if known is not None and _is_same(known.analysis, analysis):
        analysis = known.analysis
    with _lock:
        _cache[place] = _CachedStudy(people, analysis)
        _cache.move_to_end(place)
        while len(_cache) > CACHED_STUDIES:
            _cache.popitem(last=False)
    return analysis


def _is_same(one: Analysis, other: Analysis) -> bool:
    return (
        (one.arms, one.crossover) == (other.arms, other.crossover)
        and len(one.participants) == len(other.participants)
        and all(a is b for a, b in zip(one.participants, other.participants, strict=True))
    )


def _read_people(
    study: Study, until: date, known: Mapping[int, tuple[Any, Participant]]
) -> dict[int, tuple[Any, Participant]]:
    """Return everybody who was ever taken in, by enrollment; as known where nothing differs."""
    metrics, tests, answered = _sum_metrics(study), _read_tests(study), _answered_at(study)
    people = {}
    of_people = counts_people_alone(study)
    for enrollment in study.enrollments.select_related("allocation", "patient").order_by("pk"):
        visits = latest_attempts(enrollment)
        out = {visit.pk for visit in visits if _is_excluded(visit, of_people=of_people)}
        taken = tests.get(enrollment.patient_id, ())
        pk = enrollment.pk
        key = (_key(enrollment, visits, until), out, metrics.get(pk), answered.get(pk), taken)
        earlier = known.get(enrollment.pk)
        if earlier is None or earlier[0] != key:
            earlier = (key, _read(enrollment, visits, until, out, taken))
        people[enrollment.pk] = earlier
    return people


def _sum_metrics(study: Study) -> dict[int, tuple[int, float]]:
    """Return count and sum of what the sessions of each enrollment store of themselves."""
    of_whom = "session__study_visit__enrollment"
    rows = SessionMetric.everywhere.filter(**{f"{of_whom}__study": study}).order_by()
    sums = rows.values_list(of_whom).annotate(Count("pk"), Sum("value"))
    return {enrollment: (count, total) for enrollment, count, total in sums}


def _answered_at(study: Study) -> dict[int, datetime]:
    """Return when the last questionnaire of each enrollment was finished."""
    of_whom = "session__study_visit__enrollment"
    rows = QuestionnaireResponse.everywhere.filter(
        finished_at__isnull=False, **{f"{of_whom}__study": study}
    )
    return dict(rows.order_by().values_list(of_whom).annotate(Max("finished_at")))


def _read_tests(study: Study) -> dict[int, tuple[ClinicalResult, ...]]:
    """Return the results that assessors recorded while they had the mark, by patient."""
    mark = "by__study_marks"
    rows = Assessment.everywhere.filter(
        Q(**{f"{mark}__ended_at": None}) | Q(**{f"{mark}__ended_at__gt": F("at")}),
        patient__enrollments__study=study,
        struck_at=None,
        **{f"{mark}__study": study, f"{mark}__task": StudyMark.Task.ASSESSOR},
        **{f"{mark}__at__lte": F("at")},
    )
    found: dict[int, tuple[ClinicalResult, ...]] = {}
    columns = ("patient", "test", "at", "value")
    for patient, test, at, value in rows.order_by("at", "pk").values_list(*columns):
        day = clinic_time(at, study.clinic).date()
        found[patient] = (*found.get(patient, ()), ClinicalResult(test, at, day, value))
    return found


def _key(enrollment: Enrollment, visits: list[StudyVisit], until: date) -> tuple[Any, ...]:
    """Return all that decides what is read of a participant, beside the logs."""
    return (
        *(enrollment.code, enrollment.patient_id, enrollment.allocation.group),
        *(enrollment.withdrawn_at, enrollment.is_analyzed),
        *(
            (visit.number, visit.period, _is_due(visit, until), _session_key(visit))
            for visit in visits
        ),
    )


def _session_key(visit: StudyVisit) -> tuple[Any, ...] | None:
    session = visit.session
    if session is None:
        return None
    return (
        *(session.pk, session.state, session.excluded, session.patient_id, session.trained_side),
        *(session.created_at, session.ended_at, session.last_number),
    )


def _is_due(visit: StudyVisit, until: date) -> bool:
    return visit.session_id is not None or visit.day <= until


def _read(
    enrollment: Enrollment,
    visits: list[StudyVisit],
    until: date,
    excluded: set[int],
    taken: tuple[ClinicalResult, ...],
) -> Participant:
    group = enrollment.allocation.group.split("-")
    first = _first_began(enrollment) if taken else None
    changes = clinical_changes(taken, first, _days_of(visits)) if first else [{} for _ in visits]
    planned = [
        (
            ParticipantVisit(
                visit.number,
                group[visit.period],
                _is_due(visit, until),
                visit.period,
                Attendance.EXCLUDED if visit.pk in excluded else Attendance.MISSED,
                of_tests,
            ),
            None if visit.pk in excluded else _walked(enrollment, visit),
        )
        for visit, of_tests in zip(visits, changes, strict=True)
    ]
    return make_participant(
        enrollment.code,
        planned,
        has_left=enrollment.withdrawn_at is not None,
        is_analyzed=enrollment.is_analyzed,
        levels=enrollment.levels,
        clinical_baselines=clinical_baselines(taken, first) if first else {},
    )


def _first_began(enrollment: Enrollment) -> datetime | None:
    """Return when the first session began, also one that was broken off; None before it."""
    visits = enrollment.visits.select_related("session").defer(*UNREAD)
    return min((one.session.began_at for one in visits if one.session), default=None)


def _days_of(visits: list[StudyVisit]) -> list[Day]:
    """Return when visits were, or were to be, each with its window."""
    days = []
    for visit, after in zip(visits, [*visits[1:], None], strict=True):
        session = visit.session
        day = (
            visit.day
            if session is None
            else (clinic_time(session.began_at, visit.enrollment.clinic).date())
        )
        is_last = after is None or after.follow_up or after.period != visit.period
        days.append(Day(day, FOLLOW_UP if visit.follow_up else AFTER if is_last else None))
    return days


def latest_attempts(enrollment: Enrollment) -> list[StudyVisit]:
    """Return the last attempt at each planned visit, in their order."""
    visits = enrollment.visits.select_related("session").defer(*UNREAD)
    return list({visit.number: visit for visit in visits.order_by("number", "attempt")}.values())


def _is_excluded(visit: StudyVisit, *, of_people: bool) -> bool:
    """Return whether a correction took a visit's session away, or no person walked it.

    ``of_people``: what `counts_people_alone` returns.
    """
    session = visit.session
    return session is not None and (
        session.excluded
        or session.patient_id != visit.enrollment.patient_id
        or (of_people and visit.is_simulated)
    )


def _walked(enrollment: Enrollment, visit: StudyVisit) -> AnalyzedSession | None:
    """Return what a visit gave, also one that ended early; None of one that does not count."""
    session = visit.session
    if session is None or session.state not in ENDED_STATES or not enrollment.is_analyzed:
        return None
    return read_walked(session)


def read_walked(session: TrainingSession) -> AnalyzedSession:
    """Return the strides and metrics of a session that has ended.

    One that ended early stores no metrics: they are computed from its log, as far as it was walked.
    """
    plan = SessionPlan.from_json(session.plan)
    is_finished = session.state == State.FINISHED
    if is_finished:
        metrics = dict(session.metrics.values_list("slug", "value"))
    else:
        metrics = compute_metrics(fold_log(SessionFold(plan), session))
    rows = Step.everywhere.filter(session=session, side=session.trained_side).order_by("number")
    walk = read_walk(
        plan.phases,
        rows.values_list(*COLUMNS).iterator(),
        higher_is_better=plan.measure.higher_is_better,
    )
    scores = {one.slug: one.score for one in session.questionnaires.all() if one.finished_at}
    metrics |= {slug: score for slug, score in scores.items() if score is not None}
    return AnalyzedSession(walk, metrics, plan.measure.slug, is_finished)
