"""Every column of every table, shown by one row in which all values differ.

A column that takes another's value turns its table red; a new one without a value here is named.
"""

from __future__ import annotations

from datetime import UTC, date, datetime
from types import SimpleNamespace
from typing import Any

import pytest

from rehab.exports.codebook import TABLES, AnswerRow, VisitRow, codebook_rows
from rehab.exports.column_definitions import WHOSE, Type
from rehab.exports.research.bids import dataset_files
from rehab.exports.session_table import SessionRow
from rehab.exports.step_tables import StepRow
from rehab.sessions.events.step import MONITOR_FIELDS
from rehab.sessions.log import Step
from rehab.sessions.schemas import StepOut
from rehab.sessions.step_columns import STEP_COLUMNS
from rehab.training.summary.metrics import METRICS

Row: Any = SimpleNamespace  # stands for any row of the database
# What is stored of a step and in no file, with why.
NOT_EXPORTED = {"id": "says nothing", "session": "the column that every table begins with"}
OTHER_NAMES = {"time_s": "time"}  # of a field in files


def text(*names: str) -> dict[str, str]:
    """Return a value of its own for each name."""
    return {name: f"<{name}>" for name in names}


FIELDS = [field.name for field in Step._meta.concrete_fields if field.name not in NOT_EXPORTED]
STEP: dict[str, Any] = text(*FIELDS) | {"reasons": ["odd", "late"], "extra": {"knee": 1.5}}
EVENT = text("at", "after_number", "kind", "old", "value", "data")
CORRECTION = text("at", "field", "old", "new", "reason")
INCIDENT = text("at", "reason", "recording")
MESSAGE = text("number", "kind", "words", "confetti", "emblem", "points", "score", "streak")
SESSION = text(
    *("created_at", "started_at", "ended_at", "state", "changed_to", "excluded", "trained_side"),
    *("goal", "simulated"),
)
FIGURES = {slug: 1000.5 + place for place, slug in enumerate(METRICS)}
PLAN = Row(
    target=Row(hit_rate=0.61, duration_s=602),
    activation_threshold=0.83,
    cue_timing=Row(rule="streaks", window_s=6.4, count=7, rest_s=8.5),
    schedule=Row(kind="faded", interval=9, band=0.11),
    words_vary="<words_vary>",
    adaptation=Row(mode="suggest"),
    close_steps=Row(part=0.12),
    heart_rate_limit=141,
)
PATIENT = Row(
    pseudonym="P-1", birth_year=1970, stroke_month=date(2029, 3, 1), severity="mild",
    paretic_side="right",
)  # fmt: skip
WALKED: Any = Row(
    pk=41, patient=PATIENT, to_plan=lambda: PLAN, began_at=datetime(2030, 8, 1, tzinfo=UTC),
    valence="binary", measure=Row(slug="knee", unit="deg"), active_s=593.0, legacy_id=5,
    protocol=Row(name="Long"),
    late_strides=21,
    walking=Row(device="<device>", belt_speed_m_s=0.7, weight_support_percent=23.0),
    metrics=Row(all=lambda: [Row(slug=slug, value=value) for slug, value in FIGURES.items()]),
    belt_speed_m_s=0.7, weight_support_percent=23.0, last_number=100,
    walked_under=[
        Row(kind=kind, after_number=after, value=value)
        for kind, after, value in (
            ("belt_speed", 50, 0.9), ("weight_support", 50, 27.0), ("walking_aid", 10, 1),
            ("orthosis", 25, 1), ("handrail", 35, 1), ("helping_hand", 45, 1), ("borg", 60, 6.0),
            ("pain", 60, 4.0),
        )
    ],
    **SESSION,
)  # fmt: skip
ENROLLMENT = Row(
    study=Row(code="VAL"), code="VAL-003", levels=["old", "mild"], enrolled_at="<enrolled>",
    withdrawn_at="<withdrawn>",
)  # fmt: skip
VISIT = Row(number=11, attempt=12, period=13, day="<day>", version=Row(number=14))
INSTRUMENT = Row(title="<title>", language="<language>", validated="<validated>")
RESPONSE = Row(slug="<slug>", asked_at="<asked>", finished_at="<finished>")

after: Any = "<after>"
trained: Any = "<trained>"

# Of each table a row, and its cells.
ROWS: dict[str, tuple[Any, dict[str, Any]]] = {
    "sessions.csv": (
        SessionRow(WALKED, "<source>"),
        SESSION
        | FIGURES
        | {
            "feedback_type": "binary", "measure": "knee", "unit": "deg", "wanted_hit_rate": 0.61,
            "planned": 602, "walked": 593.0, "late_strides": 21,
            "protocol": "Long", "activation_threshold": 0.83,
            "robot_rule": "streaks", "robot_window": 6.4, "robot_count": 7, "robot_rest": 8.5,
            "schedule": "faded", "schedule_steps": 9, "schedule_band": 0.11,
            "words_vary": "<words_vary>",
            "goal_follows": "suggest", "close_part": 0.12, "imported": True, "source": "<source>",
            "age_band": "60-69", "months_since_stroke": 17, "severity": "mild",
            "paretic_side": "right", "device": "<device>", "belt_speed": 0.7,
            "weight_support": 23.0, "heart_rate_limit": 141,
            "mean_belt_speed": 0.8, "mean_weight_support": 25.0,
            "walking_aid": 0.9, "orthosis": 0.75, "handrail": 0.65, "helping_hand": 0.55,
            "highest_exertion": 6.0, "highest_pain": 4.0,
        },
    ),
    "steps.csv": (
        StepRow(Row(**STEP), trained, Row(**text("kind", "name", "feedback")), "<type>"),
        {OTHER_NAMES.get(field, field): value for field, value in STEP.items()}
        | {
            "reasons": "odd late", "trained": trained, "phase_kind": "<kind>",
            "phase_name": "<name>", "feedback": "<feedback>", "feedback_type": "<type>",
        },
    ),
    "feedback.csv": (
        MESSAGE | {"shown": 2.5, "summary": {"steps": 5}},
        MESSAGE | {"value_shown": 2.5, "summary_steps": 5},
    ),
    "events.csv": (Row(**EVENT, who="<who>"), EVENT | {"by": "<who>"}),
    "corrections.csv": (Row(**CORRECTION, who="<who>"), CORRECTION | {"by": "<who>"}),
    "incidents.csv": (Row(**INCIDENT), INCIDENT),
    "assessments.csv": (
        Row(
            **text("at", "test", "value", "device"),
            answers=[["Bends", 2.0], ["Angle", 30.5]],
            definition=Row(unit="<unit>", loinc="<loinc>"),
        ),
        {
            "taken_at": "<at>", "test": "<test>", "result": "<value>", "unit": "<unit>",
            "answers": "Bends=2; Angle=30.5", "device": "<device>", "loinc": "<loinc>",
        },
    ),
    "answers.csv": (
        AnswerRow(RESPONSE, INSTRUMENT, 71.5, 6, Row(text="How?", values=range(1, 10)), 4),
        {
            "questionnaire": "<slug>", "title": "<title>", "asked_at": "<asked>",
            "finished_at": "<finished>", "language": "<language>", "validated": "<validated>",
            "item": 6, "text": "How?", "answer": 4, "lowest": 1, "highest": 9, "score": 71.5,
        },
    ),
    "study_visits.csv": (
        VisitRow(VISIT, ENROLLMENT, after, "A-B", "B"),
        {
            "study": "VAL", "participant": "VAL-003", "visit": 11, "attempt": 12, "period": 13,
            "planned_day": "<day>", "version": 14, "levels": "old, mild",
            "enrolled_at": "<enrolled>", "withdrawn_at": "<withdrawn>",
            "after_withdrawal": after, "group": "A-B", "arm": "B",
        },
    ),
}  # fmt: skip


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.file)
def test_each_column_has_its_own_value(table):
    row, cells = ROWS[table.file]
    assert {column.name: column.get(row) for column in table.own} == cells
    assert len(set(map(repr, cells.values()))) == len(cells), "values that differ tell a swap"
    assert table.header == [*(column.name for column in WHOSE), *(c.name for c in table.own)]
    assert len(set(table.header)) == len(table.header)


def test_every_table_begins_with_whose_it_is():
    assert [(column.name, column.get(WALKED)) for column in WHOSE] == [
        *(("session", 41), ("patient", "P-1"))
    ]


def test_a_stroke_in_the_month_of_the_session_is_not_missing_in_motion_data():
    people = [{"participant_id": "sub-1", "months_since_stroke": 0, "severity": ""}]
    text_of = dict(dataset_files(people, "1"))["participants.tsv"]
    header, row = (line.split("\t") for line in text_of.splitlines())
    cells = dict(zip(header, row, strict=True))
    assert (cells["months_since_stroke"], cells["severity"]) == ("0", "n/a")


def test_the_codebook_explains_every_column():
    told = {(file, name): about for file, name, *about in codebook_rows()}
    assert list(told) == [(table.file, column.name) for table in TABLES for column in table.columns]
    assert all(meaning for _, meaning, *_ in told.values())
    assert told["steps.csv", "value"][:3] == ["the measure's unit", "What was measured.", "number"]
    assert {told[key][0] for key in told if told[key][2] is Type.TIME} == {"UTC"}


def test_what_is_stored_of_a_step_goes_to_files_api_and_therapist_by_itself():
    """A new field of a step is named here until `STEP_COLUMNS` says what it means."""
    assert sorted(column.field for column in STEP_COLUMNS) == sorted(FIELDS)
    assert set(StepOut.model_fields) == set(FIELDS)
    assert set(MONITOR_FIELDS) == set(FIELDS) - {"received_at", "late", "rules_version"}
