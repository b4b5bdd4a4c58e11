"""All tables of exports, and the codebook that says what their columns mean."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from django.utils.translation import gettext_lazy as _

from rehab.exports.column_definitions import Column, Table, Type
from rehab.exports.selection import Selection
from rehab.exports.session_table import SESSIONS
from rehab.exports.step_tables import FEEDBACK, STEPS
from rehab.questionnaires.instrument import Instrument, Item
from rehab.questionnaires.standard_tests import CLINICAL_TESTS
from rehab.sessions.assessment_results import Assessment, assessments_with
from rehab.sessions.corrections import SessionCorrection
from rehab.sessions.log import SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.questionnaires import QuestionnaireResponse
from rehab.sessions.robot_incidents import RobotIncident
from rehab.studies.models import StudyState
from rehab.studies.participants import Enrollment, StudyVisit
from rehab.training.scoring import RULES_VERSION


def _read_columns(model: type[Any], *names: str) -> Callable[[Selection, Any], Iterator[Any]]:
    """Return what reads columns of a model's rows."""
    return lambda selection, session: selection.read_pages(model, session, ("pk", *names))


BY = Column("by", "Who did it; for researchers only that it was a person.", "who")
EVENTS = Table(
    "events.csv",
    _("a row for each thing done or noted during a session"),
    _read_columns(SessionEvent, "at", "after_number", "kind", "old", "value", "who", "data"),
    (
        Column.time("at", "When it happened."),
        Column.integer("after_number", "Number of the last step before it; 0 for none."),
        Column("kind", "What was done, noted, or done by the robot."),
        Column("old", "Value before, where something was changed.", type=Type.NUMBER),
        Column(
            "value",
            "Value after; of a remark: Borg, pain 0 to 10; belt m/s; support %; an aid 1 or 0.",
            type=Type.NUMBER,
        ),
        BY,
        Column(
            "data",
            "What the robot reported, or which device stopped it.",
            lambda row: row.data or None,
            Type.JSON,
        ),
    ),
)
CORRECTIONS = Table(
    "corrections.csv",
    _("a row for each correction of a session after its end"),
    _read_columns(SessionCorrection, "at", "field", "old", "new", "reason", "who"),
    (
        Column.time("at", "When it was corrected."),
        Column("field", "patient: who walked; counts: whether it counts; note: a note on it."),
        Column("old", "The value before; patients by pseudonym."),
        Column("new", "The value from then on."),
        Column("reason", "Why."),
        BY,
    ),
)
INCIDENTS = Table(
    "incidents.csv",
    _("what the robot recorded: around its stops, and of its motion"),
    _read_columns(RobotIncident, "at", "reason", "recording"),
    (
        Column.time("at", "When the robot was stopped; of its motion, when the part ended."),
        Column("reason", "Why, as a code (/help/safety/); motion: a part of how it moved."),
        Column("recording", "What it received, ordered and did: base64 of zlib of JSON lines."),
    ),
)


class AnswerRow(NamedTuple):
    """A question of a questionnaire with its answer."""

    response: QuestionnaireResponse
    instrument: Instrument
    score: float | None
    number: int
    item: Item
    answer: int | None


def read_answers(selection: Selection, session: TrainingSession) -> Iterator[AnswerRow]:
    """Yield the questions that were asked after a session."""
    rows = QuestionnaireResponse.objects.visible_to(selection.user).filter(session=session)
    for response in rows.order_by("pk"):
        instrument, score = response.to_instrument(), response.score
        answered = zip(instrument.items, response.all_answers, strict=True)
        for number, (item, answer) in enumerate(answered, 1):
            yield AnswerRow(response, instrument, score, number, item, answer)


ANSWERS = Table(
    "answers.csv",
    _("a row for each question of a questionnaire"),
    read_answers,
    (
        Column(
            "questionnaire",
            "sus, tlx, or own- and a number for a clinic's own one.",
            "response.slug",
        ),
        Column("title", "Its name.", "instrument.title"),
        Column.time("asked_at", "When it was planned.", "response.asked_at"),
        Column.time("finished_at", "When it was finished or stopped.", "response.finished_at"),
        Column("language", "The language that it was asked in.", "instrument.language"),
        Column.flag(
            "validated", "false: this translation was not validated.", "instrument.validated"
        ),
        Column.integer("item", "Number of the question, from 1.", "number"),
        Column("text", "The question as it was asked.", "item.text"),
        Column.integer("answer", "Empty: skipped, or not reached.", "answer", "points"),
        Column.integer(
            "lowest", "First point of its scale.", lambda row: row.item.values[0], "points"
        ),
        Column.integer(
            "highest", "Last point of its scale.", lambda row: row.item.values[-1], "points"
        ),
        Column.number("score", "0 to 100", "Of the whole questionnaire, on each row.", "score"),
    ),
)


class VisitRow(NamedTuple):
    """A visit of a study. ``group`` and ``arm`` are empty until the study is closed."""

    visit: StudyVisit
    enrollment: Enrollment
    after_withdrawal: bool
    group: str
    arm: str


def read_study_visits(selection: Selection, session: TrainingSession) -> Iterator[VisitRow]:
    """Yield the visits that a session is of."""
    related = ("enrollment__study", "enrollment__allocation", "version")
    visits = StudyVisit.objects.visible_to(selection.user).select_related(*related)
    for visit in visits.filter(session=session).order_by("pk"):
        enrollment, group, arm = visit.enrollment, "", ""
        left = enrollment.withdrawn_at
        if enrollment.study.state == StudyState.CLOSED:
            group = enrollment.allocation.group
            arm = group and group.split("-")[visit.period]
        is_after = left is not None and session.began_at >= left
        yield VisitRow(visit, enrollment, is_after, group, arm)


STUDY_VISITS = Table(
    "study_visits.csv",
    _("which session was which visit of a study"),
    read_study_visits,
    (
        Column("study", "Short name of the study.", "enrollment.study.code"),
        Column("participant", "Code in the study.", "enrollment.code"),
        Column.integer("visit", "Number of the visit.", "visit.number"),
        Column.integer(
            "attempt", "2 and more after a session that was broken off.", "visit.attempt"
        ),
        Column.integer("period", "Number of the period, from 0.", "visit.period"),
        Column("planned_day", "The day it was planned for.", "visit.day", Type.DATE),
        Column.integer(
            "version",
            "Version of the study that the session follows.",
            lambda row: row.visit.version and row.visit.version.number,
        ),
        Column(
            "levels",
            "Levels of the study's factors, with commas between.",
            lambda row: ", ".join(row.enrollment.levels),
        ),
        Column.time("enrolled_at", "When the participant was enrolled.", "enrollment.enrolled_at"),
        Column.time(
            "withdrawn_at", "When the participant left the study.", "enrollment.withdrawn_at"
        ),
        Column.flag("after_withdrawal", "true: begun later, as care."),
        Column("group", "What was allocated; sealed (empty) until the study is closed."),
        Column("arm", "The arm of this visit; sealed (empty) until the study is closed."),
    ),
)


def read_assessments(selection: Selection, session: TrainingSession) -> Iterator[Assessment]:
    """Yield the results of tests that go with a session."""
    yield from assessments_with(selection.user, session)


ASSESSMENTS = Table(
    "assessments.csv",
    _("results of tests, each with the session that it goes with"),
    read_assessments,
    (
        Column.time("taken_at", "When it was taken.", "at"),
        Column(
            "test", f"{', '.join(CLINICAL_TESTS)}, or own-… for a form of the clinic's own.", "test"
        ),
        Column.number("result", "the test's unit", "The result.", "value"),
        Column("unit", "Its unit; empty for points.", "definition.unit"),
        Column(
            "answers",
            "Of a form of the clinic's own, what the result is the sum of: item=number, with ; "
            "between them.",
            lambda row: "; ".join(f"{text}={number:g}" for text, number in row.answers),
        ),
        Column("device", "What the patient walked with.", "device"),
        Column("loinc", "Code in LOINC; empty where none fits.", "definition.loinc"),
    ),
)
# Steps come before events, whose times count from the first step in motion data (research.bids).
TABLES = (
    *(SESSIONS, STEPS, FEEDBACK, EVENTS, ANSWERS),
    *(ASSESSMENTS, CORRECTIONS, INCIDENTS, STUDY_VISITS),
)
CODEBOOK = ("file", "column", "unit", "meaning", "type", "rules_version")


def codebook_rows() -> Iterator[tuple[Any, ...]]:
    """Yield `CODEBOOK` of every column: with the rules that this version of GARRY judges by."""
    for table in TABLES:
        for column in table.columns:
            about = (column.unit, column.meaning, column.type)
            yield (table.file, column.name, *about, RULES_VERSION)
