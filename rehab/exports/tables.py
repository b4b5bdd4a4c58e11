"""The tables of exports, and the meaning of each column."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

from rehab.people.models import Patient
from rehab.people.policy import covariates
from rehab.sessions.setup.option import AS_IS
from rehab.sessions.setup.options import exported_options
from rehab.training.scoring import RULES_VERSION
from rehab.training.summary.metrics import METRICS


class Type(StrEnum):
    """What the cells of a column hold."""

    TEXT = "text"
    INTEGER = "integer"
    NUMBER = "number"
    BOOLEAN = "boolean"  # true or false
    TIME = "time"  # ISO 8601, UTC
    DATE = "date"  # ISO 8601
    JSON = "json"


class Column(NamedTuple):
    """The name, unit, meaning and type of a column."""

    name: str
    unit: str
    meaning: str
    type: Type = Type.TEXT


@dataclass(frozen=True)
class Table:
    """A CSV file with its columns."""

    file: str
    columns: tuple[Column, ...]


def _option_columns() -> Iterator[Column]:
    """Yield the columns of the set-up options."""
    types = {bool: Type.BOOLEAN, int: Type.INTEGER, float: Type.NUMBER}
    for option, column in exported_options():
        # Units of the plan are ratios and seconds, also where people give whole numbers.
        kind = types.get(option.kind, Type.TEXT) if option.conversion is AS_IS else Type.NUMBER
        yield Column(*column, kind)


# Which session a row is of, and whose.
WHOSE = (
    Column("session", "", "Number of the session.", Type.INTEGER),
    Column("patient", "", "Pseudonym."),
)
SESSIONS = Table(
    "sessions.csv",
    (
        Column(
            "session", "", "Number of the session; leads to its steps and events.", Type.INTEGER
        ),
        Column("patient", "", "Pseudonym."),
        Column("created_at", "UTC", "When it was set up.", Type.TIME),
        Column("started_at", "UTC", "When the patient began to walk.", Type.TIME),
        Column("ended_at", "UTC", "When it ended.", Type.TIME),
        Column("state", "", "ready, running, paused, finished or aborted (ended early)."),
        Column("feedback_type", "", "positive, negative, binary or explicit, as it began."),
        Column("changed_to", "", "Feedback types it was changed to, with commas between."),
        Column(
            "excluded",
            "",
            "true: a therapist left it out of figures (corrections.csv).",
            Type.BOOLEAN,
        ),
        Column("measure", "", "What was trained; a2 is ankle push-off power."),
        Column("unit", "", "Unit of values and goals of this session."),
        Column("trained_side", "", "The leg whose steps count."),
        Column("goal", "the measure's unit", "Goal in force at the end.", Type.NUMBER),
        Column("walked", "s", "Time of walking, without pauses.", Type.NUMBER),
        Column("protocol", "", "Name of the list of phases it was built from."),
        *_option_columns(),
        Column(
            "close_part",
            "ratio",
            "Part of a value's 95 % interval beyond the goal that makes a step close; empty: none.",
            Type.NUMBER,
        ),
        Column("simulated", "", "true: no person walked.", Type.BOOLEAN),
        Column("imported", "", "true: from the original GARRY, which kept no steps.", Type.BOOLEAN),
        Column("source", "", "Where its steps came from; empty for researchers."),
        *(Column(c.name, c.unit, c.meaning, Type(c.type)) for c in covariates(Patient).values()),
        *(
            Column(m.slug, m.unit or "ratio", f"{m.label} of the session.", Type.NUMBER)
            for m in METRICS.values()
        ),
    ),
)
STEPS = Table(
    "steps.csv",
    (
        *WHOSE,
        Column("number", "", "Number of the step in its session, from 1, both legs.", Type.INTEGER),
        Column("time", "s", "Time of the step on the source's clock.", Type.NUMBER),
        Column("received_at", "UTC", "When the server received it.", Type.TIME),
        Column("side", "", "left or right."),
        Column(
            "trained",
            "",
            "true: a step of the trained leg; the others are never scored.",
            Type.BOOLEAN,
        ),
        Column("value", "the measure's unit", "What was measured.", Type.NUMBER),
        Column("gain", "ratio", "Factor between the value and what the patient saw.", Type.NUMBER),
        Column("shown", "the measure's unit", "gain × value, where a goal was known.", Type.NUMBER),
        Column("goal", "the measure's unit", "Goal in force at this step.", Type.NUMBER),
        Column("performance", "ratio", "shown / goal.", Type.NUMBER),
        Column("hit", "", "true: performance of 1 or more.", Type.BOOLEAN),
        Column("close", "", "true: too uncertain to count as hit or miss.", Type.BOOLEAN),
        Column("late", "", "true: it came too late to be shown as live.", Type.BOOLEAN),
        Column("points", "points", "Points given or taken.", Type.INTEGER),
        Column("valid", "", "false: not shown, paid or punished.", Type.BOOLEAN),
        Column("reasons", "", "Why it is not valid, separated by blanks."),
        Column("phase", "", "Number of its phase in the session, from 0.", Type.INTEGER),
        Column("phase_kind", "", "baseline, familiarization, training, catch, washout, retention."),
        Column("phase_name", "", "Name of the phase."),
        Column("feedback", "", "true: the patient got feedback in this phase.", Type.BOOLEAN),
        Column("feedback_type", "", "The type in force; empty in a phase without feedback."),
        Column("rules_version", "", "Version of the rules that judged the step.", Type.INTEGER),
        Column("extra", "JSON", "What else the source measured of it, by name.", Type.JSON),
    ),
)
EVENTS = Table(
    "events.csv",
    (
        *WHOSE,
        Column("at", "UTC", "When it happened.", Type.TIME),
        Column("after_number", "", "Number of the last step before it; 0 for none.", Type.INTEGER),
        Column("kind", "", "What was done, noted, or done by the robot."),
        Column("old", "", "Value before, where something was changed.", Type.NUMBER),
        Column("value", "", "Value after; of a remark its strength (Borg 0 to 10).", Type.NUMBER),
        Column("by", "", "Who did it; for researchers only that it was a person."),
        Column("data", "JSON", "What the robot reported, or which device stopped it.", Type.JSON),
    ),
)
CORRECTIONS = Table(
    "corrections.csv",
    (
        Column(
            "session", "", "Number of the session that was corrected after its end.", Type.INTEGER
        ),
        Column("patient", "", "Pseudonym of who walked it, as it holds now."),
        Column("at", "UTC", "When it was corrected.", Type.TIME),
        Column("field", "", "patient: who walked; counts: whether it counts; note: a note on it."),
        Column("old", "", "What stood there before; patients by pseudonym."),
        Column("new", "", "What holds from then on."),
        Column("reason", "", "Why."),
        Column("by", "", "Who did it; for researchers only that it was a person."),
    ),
)
INCIDENTS = Table(
    "incidents.csv",
    (
        Column(
            "session", "", "Number of the session in which the robot was stopped.", Type.INTEGER
        ),
        Column("patient", "", "Pseudonym."),
        Column("at", "UTC", "When.", Type.TIME),
        Column("reason", "", "Why, as a code (docs/safety.md)."),
        Column("recording", "", "What it heard, ordered and did: base64 of zlib of JSON lines."),
    ),
)
FEEDBACK = Table(
    "feedback.csv",
    (
        *WHOSE,
        Column("number", "", "Number of the step that was answered.", Type.INTEGER),
        Column("kind", "", "step, or missing: the page said that it had no value."),
        Column("words", "", "What the page said, in the patient's language; empty: nothing."),
        Column("confetti", "", "none, little, much or most; a calm page shows none."),
        Column("emblem", "", "The sign that the page drew."),
        Column("points", "points", "Points that the page told.", Type.INTEGER),
        Column("score", "points", "The sum that the page showed.", Type.INTEGER),
        Column("streak", "steps", "The row of hits that the page showed.", Type.INTEGER),
        Column("value_shown", "the measure's unit", "The value as a number, if told.", Type.NUMBER),
        Column("summary_steps", "steps", "Of how many steps it was the summary.", Type.INTEGER),
    ),
)
ANSWERS = Table(
    "answers.csv",
    (
        *WHOSE,
        Column("questionnaire", "", "sus, tlx, or own- and a number for a clinic's own one."),
        Column("title", "", "Its name."),
        Column("asked_at", "UTC", "When it was planned.", Type.TIME),
        Column("finished_at", "UTC", "When it was finished or stopped.", Type.TIME),
        Column("language", "", "The language that it was asked in."),
        Column("validated", "", "false: this translation was not validated.", Type.BOOLEAN),
        Column("item", "", "Number of the question, from 1.", Type.INTEGER),
        Column("text", "", "The question as it was asked."),
        Column("answer", "points", "Empty: skipped, or not reached.", Type.INTEGER),
        Column("lowest", "points", "First point of its scale.", Type.INTEGER),
        Column("highest", "points", "Last point of its scale.", Type.INTEGER),
        Column("score", "0 to 100", "Of the whole questionnaire, on each row.", Type.NUMBER),
    ),
)
STUDY_VISITS = Table(
    "study_visits.csv",
    (
        Column("session", "", "Number of the session of a study's visit.", Type.INTEGER),
        Column("patient", "", "Pseudonym."),
        Column("study", "", "Short name of the study."),
        Column("participant", "", "Code in the study."),
        Column("visit", "", "Number of the visit.", Type.INTEGER),
        Column("attempt", "", "2 and more after a session that was broken off.", Type.INTEGER),
        Column("period", "", "Number of the period, from 0.", Type.INTEGER),
        Column("planned_day", "", "The day it was planned for.", Type.DATE),
        Column("version", "", "Version of the study that the session follows.", Type.INTEGER),
        Column("levels", "", "Levels of the study's factors, with commas between."),
        Column("enrolled_at", "UTC", "When the participant was enrolled.", Type.TIME),
        Column("withdrawn_at", "UTC", "When the participant left the study.", Type.TIME),
        Column("after_withdrawal", "", "true: begun later, as care.", Type.BOOLEAN),
        Column("group", "", "What was allocated; sealed (empty) until the study is closed."),
        Column("arm", "", "The arm of this visit; sealed (empty) until the study is closed."),
    ),
)
TABLES = (SESSIONS, STEPS, FEEDBACK, EVENTS, ANSWERS, CORRECTIONS, INCIDENTS, STUDY_VISITS)
CODEBOOK = ("file", "column", "unit", "meaning", "type", "rules_version")


def codebook_rows() -> Iterator[tuple[Any, ...]]:
    """Yield `CODEBOOK` of every column: with the rules that this version of GARRY judges by."""
    for table in TABLES:
        yield from ((table.file, *column, RULES_VERSION) for column in table.columns)
