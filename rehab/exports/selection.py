"""The rows of exported tables, read page by page.

Rows are read in pages by key, so that neither memory nor the database holds more than a page while
a browser is slow. `visible_to` decides which rows a user may see; ``named`` says whether they may
hold anything but pseudonyms.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from django.db.models import QuerySet

from rehab.exports.tables import (
    ANSWERS,
    CORRECTIONS,
    EVENTS,
    FEEDBACK,
    INCIDENTS,
    SESSIONS,
    STEPS,
    STUDY_VISITS,
    Table,
)
from rehab.exports.told import told_steps
from rehab.people.models import Patient, User
from rehab.people.policy import covariates
from rehab.sessions.corrections import SessionCorrection
from rehab.sessions.incidents import RobotIncident
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.questionnaires import QuestionnaireResponse
from rehab.sessions.replay import fold_log
from rehab.sessions.setup.options import exported_options
from rehab.studies.models import StudyState
from rehab.studies.participants import StudyVisit
from rehab.training.fold import SessionFold
from rehab.training.summary.metrics import METRICS

PAGE_ROWS = 2_000  # rows held in memory
SESSIONS_PAGE = 200
STEP_FIELDS = (
    *("number", "time_s", "received_at", "side", "value", "gain", "shown", "goal", "performance"),
    *("hit", "close", "late", "points", "valid", "reasons", "phase", "rules_version", "extra"),
)
NUMBER, SIDE, REASONS, PHASE = (
    STEP_FIELDS.index(name) for name in ("number", "side", "reasons", "phase")
)


@dataclass(frozen=True)
class Selection:
    """Sessions that a user may see. ``named``: whether therapists and sources are named."""

    user: User
    sessions: QuerySet[TrainingSession]
    named: bool
    keys: list[int] = field(init=False)

    def __post_init__(self) -> None:
        keys = self.sessions.order_by("pk").values_list("pk", flat=True)
        object.__setattr__(self, "keys", list(keys))

    def read_sessions(self) -> Iterator[TrainingSession]:
        """Yield the sessions, oldest first."""
        related = ("patient", "measure", "protocol")
        for first in range(0, len(self.keys), SESSIONS_PAGE):
            page = self.keys[first : first + SESSIONS_PAGE]
            yield from self.sessions.filter(pk__in=page).select_related(*related).order_by("pk")

    def _with_metrics(self) -> Iterator[tuple[TrainingSession, dict[str, float]]]:
        """Yield the sessions with their metrics, which are read a page at a time."""
        sessions = self.read_sessions()
        while page := list(islice(sessions, SESSIONS_PAGE)):
            metrics: dict[int, dict[str, float]] = {session.pk: {} for session in page}
            rows = SessionMetric.objects.visible_to(self.user).filter(session__in=list(metrics))
            for key, slug, value in rows.values_list("session_id", "slug", "value"):
                metrics[key][slug] = value
            yield from ((session, metrics[session.pk]) for session in page)

    def session_rows(self) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of ``SESSIONS``."""
        for session, metrics in self._with_metrics():
            plan, walking = session.to_plan(), session.walking
            yield (
                session.pk,
                session.patient.pseudonym,
                session.created_at,
                session.started_at,
                session.ended_at,
                session.state,
                session.valence,
                session.changed_to,
                session.excluded,
                session.measure.slug,
                session.measure.unit,
                session.trained_side,
                session.goal,
                session.active_s,
                session.protocol and session.protocol.name,
                *(option.get(plan, walking) for option, _column in exported_options()),
                plan.close_steps.part,
                session.simulated,
                session.legacy_id is not None,
                session.source if self.named else "",
                *_read_covariates(session),
                *(metrics.get(slug) for slug in METRICS),
            )

    def step_rows(self) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of ``STEPS``."""
        steps = Step.objects.visible_to(self.user).order_by("number")
        for session in self.read_sessions():
            known = [
                (phase["kind"], phase["name"], phase["feedback"])
                for phase in session.plan["phases"]
            ]
            head = (session.pk, session.patient.pseudonym)
            switches = _valence_switches(session)
            for step in _read_pages(steps.filter(session=session), STEP_FIELDS, "number"):
                *row, version, extra = step
                trained = row[SIDE] == session.trained_side
                row[REASONS] = " ".join(row[REASONS])
                row.insert(SIDE + 1, trained)
                phase = known[step[PHASE]]
                *_, feedback = phase
                kind = next(slug for after, slug in switches if after < step[NUMBER])
                yield (*head, *row, *phase, kind if feedback else "", version, extra or None)

    def event_rows(self) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of ``EVENTS``."""
        names = ("pk", "at", "after_number", "kind", "old", "value", "by__username", "data")
        events = SessionEvent.objects.visible_to(self.user).order_by("pk")
        for session in self.read_sessions():
            head = (session.pk, session.patient.pseudonym)
            for _, *row, by, data in _read_pages(events.filter(session=session), names, "pk"):
                who = by if self.named or not by else "person"
                yield (*head, *row, who, data or None)

    def correction_rows(self) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of ``CORRECTIONS``."""
        names = ("pk", "at", "field", "old", "new", "reason", "by__username")
        corrections = SessionCorrection.objects.visible_to(self.user).order_by("pk")
        for session in self.read_sessions():
            head = (session.pk, session.patient.pseudonym)
            for _, *row, by in _read_pages(corrections.filter(session=session), names, "pk"):
                yield (*head, *row, by if self.named or not by else "person")

    def incident_rows(self) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of ``INCIDENTS``."""
        names = ("pk", "at", "reason", "recording")
        incidents = RobotIncident.objects.visible_to(self.user).order_by("pk")
        for session in self.read_sessions():
            head = (session.pk, session.patient.pseudonym)
            for _, *row in _read_pages(incidents.filter(session=session), names, "pk"):
                yield (*head, *row)

    def feedback_rows(self) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of ``FEEDBACK``: the log is folded again, as the live page folded it."""
        for session in self.read_sessions():
            head = (session.pk, session.patient.pseudonym)
            yield from ((*head, *told) for told in told_steps(session))

    def answer_rows(self) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of ``ANSWERS``."""
        responses = QuestionnaireResponse.objects.visible_to(self.user).order_by("pk")
        for session in self.read_sessions():
            for row in responses.filter(session=session):
                instrument, score = row.to_instrument(), row.score
                head = (
                    *(session.pk, session.patient.pseudonym, row.slug, instrument.title),
                    *(row.asked_at, row.finished_at, instrument.language, instrument.validated),
                )
                answered = zip(instrument.items, row.all_answers, strict=True)
                for number, (item, given) in enumerate(answered, 1):
                    ends = (item.values[0], item.values[-1])
                    yield (*head, number, item.text, given, *ends, score)

    def study_visit_rows(self) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of ``STUDY_VISITS``. Allocations stay sealed until the study is closed."""
        related = ("enrollment__study", "enrollment__allocation", "version")
        visits = StudyVisit.objects.visible_to(self.user).select_related(*related).order_by("pk")
        for session in self.read_sessions():
            for visit in visits.filter(session=session):
                enrollment = visit.enrollment
                left, group = enrollment.withdrawn_at, ""
                if enrollment.study.state == StudyState.CLOSED:
                    group = enrollment.allocation.group
                yield (
                    session.pk,
                    session.patient.pseudonym,
                    *(enrollment.study.code, enrollment.code),
                    *(visit.number, visit.attempt, visit.period, visit.day),
                    visit.version and visit.version.number,
                    ", ".join(enrollment.levels),
                    *(enrollment.enrolled_at, left),
                    left is not None and session.began_at >= left,
                    *(group, group and group.split("-")[visit.period]),
                )

    def read(self, table: Table) -> Iterator[tuple[Any, ...]]:
        """Return the rows of a table."""
        rows = {
            SESSIONS.file: self.session_rows,
            STEPS.file: self.step_rows,
            EVENTS.file: self.event_rows,
            CORRECTIONS.file: self.correction_rows,
            INCIDENTS.file: self.incident_rows,
            FEEDBACK.file: self.feedback_rows,
            ANSWERS.file: self.answer_rows,
            STUDY_VISITS.file: self.study_visit_rows,
        }
        return rows[table.file]()


def _valence_switches(session: TrainingSession) -> list[tuple[int, str]]:
    """Return the valences in force, the last one first, each with the step that it came after."""
    if not session.changed_to:
        return [(-1, session.valence)]
    switches = fold_log(SessionFold(session.to_plan()), session).valences.switches
    return [*reversed(switches), (-1, session.valence)]


def _read_pages(rows: QuerySet[Any], names: Sequence[str], key: str) -> Iterator[tuple[Any, ...]]:
    """Yield values of rows that are ordered by a unique key."""
    place, after = names.index(key), None
    while True:
        rest = rows if after is None else rows.filter(**{f"{key}__gt": after})
        page = list(rest.values_list(*names)[:PAGE_ROWS])
        yield from page
        if len(page) < PAGE_ROWS:
            return
        after = page[-1][place]


def _read_covariates(session: TrainingSession) -> tuple[Any, ...]:
    """Return what analyses adjust by, in bands: no date of birth or of the stroke."""
    patient, day = session.patient, session.began_at.date()
    return (
        *(each.value(getattr(patient, name), day) for name, each in covariates(Patient).items()),
    )
