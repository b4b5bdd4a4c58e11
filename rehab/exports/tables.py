"""The tables of exports: the meaning of each column, and the format of values."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, NamedTuple

from rehab.training.metrics import METRICS


class Column(NamedTuple):
    """The name, unit and meaning of a column."""

    name: str
    unit: str
    meaning: str


@dataclass(frozen=True)
class Table:
    """A CSV file with its columns."""

    file: str
    columns: tuple[Column, ...]


SESSIONS = Table(
    "sessions.csv",
    (
        Column("session", "", "Number of the session; leads to its steps and events."),
        Column("patient", "", "Pseudonym."),
        Column("created_at", "UTC", "When it was set up."),
        Column("started_at", "UTC", "When the patient began to walk."),
        Column("ended_at", "UTC", "When it ended."),
        Column("state", "", "ready, running, paused, finished or aborted (ended early)."),
        Column("feedback_type", "", "positive, negative, binary or explicit, as it began."),
        Column("changed_to", "", "Feedback types it was changed to, with commas between."),
        Column("excluded", "", "true: a therapist left it out of figures (corrections.csv)."),
        Column("measure", "", "What was trained; a2 is ankle push-off power."),
        Column("unit", "", "Unit of values and goals of this session."),
        Column("trained_side", "", "The leg whose steps count."),
        Column("goal", "the measure's unit", "Goal in force at the end."),
        Column("wanted_hit_rate", "ratio", "Share of steps at the goal that the therapist wanted."),
        Column("planned", "s", "Planned time of walking."),
        Column("walked", "s", "Time of walking, without pauses."),
        Column("protocol", "", "Name of the list of phases it was built from."),
        Column("activation_threshold", "ratio", "Mean performance from which the robot answers."),
        Column("robot_rule", "", "What its gestures answer: windows, streaks or steps."),
        Column("robot_window", "s", "Length of a window."),
        Column("robot_count", "", "Steps of a streak, or of which each last one is answered."),
        Column("robot_rest", "s", "Least time between the starts of two gestures."),
        Column("schedule", "", "When the patient was told: every, bandwidth, faded or summary."),
        Column("schedule_steps", "", "Steps from one time to the next (of faded: at most)."),
        Column("schedule_band", "ratio", "Half of the band about the goal without feedback."),
        Column("goal_follows", "", "off, suggest or automatic, as it began."),
        Column(
            "close_part",
            "ratio",
            "Part of a value's 95 % interval beyond the goal that makes a step close; empty: none.",
        ),
        Column("simulated", "", "true: no person walked."),
        Column("imported", "", "true: from the original GARRY, which kept no steps."),
        Column("source", "", "Where its steps came from; empty for researchers."),
        *(
            Column(m.slug, m.unit or "ratio", f"{m.label} of the session.")
            for m in METRICS.values()
        ),
    ),
)
STEPS = Table(
    "steps.csv",
    (
        Column("session", "", "Number of the session."),
        Column("patient", "", "Pseudonym."),
        Column("number", "", "Number of the step in its session, from 1, both legs."),
        Column("time", "s", "Time of the step on the source's clock."),
        Column("received_at", "UTC", "When the server received it."),
        Column("side", "", "left or right."),
        Column("trained", "", "true: a step of the trained leg; the others are never scored."),
        Column("value", "the measure's unit", "What was measured."),
        Column("gain", "ratio", "Factor between the value and what the patient saw."),
        Column("shown", "the measure's unit", "gain × value, where a goal was known."),
        Column("goal", "the measure's unit", "Goal in force at this step."),
        Column("performance", "ratio", "shown / goal."),
        Column("hit", "", "true: performance of 1 or more."),
        Column("close", "", "true: too uncertain to count as hit or miss."),
        Column("points", "points", "Points given or taken."),
        Column("valid", "", "false: not shown, paid or punished."),
        Column("reasons", "", "Why it is not valid, separated by blanks."),
        Column("phase", "", "Number of its phase in the session, from 0."),
        Column("phase_kind", "", "baseline, familiarization, training, catch, washout, retention."),
        Column("phase_name", "", "Name of the phase."),
        Column("feedback", "", "true: the patient got feedback in this phase."),
        Column("feedback_type", "", "The type in force; empty in a phase without feedback."),
        Column("rules_version", "", "Version of the rules that judged the step."),
        Column("extra", "JSON", "What else the source measured of it, by name."),
    ),
)
EVENTS = Table(
    "events.csv",
    (
        Column("session", "", "Number of the session."),
        Column("patient", "", "Pseudonym."),
        Column("at", "UTC", "When it happened."),
        Column("after_number", "", "Number of the last step before it; 0 for none."),
        Column("kind", "", "What was done, noted, or done by the robot."),
        Column("old", "", "Value before, where something was changed."),
        Column("value", "", "Value after; of a remark its strength (Borg 0 to 10)."),
        Column("by", "", "Who did it; for researchers only that it was a person."),
        Column("data", "JSON", "What the robot reported, or which device stopped it."),
    ),
)
CORRECTIONS = Table(
    "corrections.csv",
    (
        Column("session", "", "Number of the session that was corrected after its end."),
        Column("patient", "", "Pseudonym of who walked it, as it holds now."),
        Column("at", "UTC", "When it was corrected."),
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
        Column("session", "", "Number of the session in which the robot was stopped."),
        Column("patient", "", "Pseudonym."),
        Column("at", "UTC", "When."),
        Column("reason", "", "Why, as a code (docs/safety.md)."),
        Column("recording", "", "What it heard, ordered and did: base64 of zlib of JSON lines."),
    ),
)
TABLES = (SESSIONS, STEPS, EVENTS, CORRECTIONS, INCIDENTS)


def codebook_rows() -> Iterator[tuple[str, ...]]:
    """Yield file, name, unit and meaning of every column of every table."""
    for table in TABLES:
        yield from ((table.file, *column) for column in table.columns)


# Where a cell may begin for a spreadsheet, before what begins a formula (also in East Asian width).
FORMULA_START = re.compile(r"(?:^|(?<=[;\t\r\n]))(?=[=+\-@＝＋－＠\t\r\n'])")


def format_cell(value: Any) -> Any:
    """Return a value as it is written to a file: floats exactly, text never as a formula.

    A text that a spreadsheet could take for a formula gets a ' before it, at its beginning and,
    since some split lines there, behind each semicolon, tab and line end; so does a '. Taking these
    off gives back the original.
    """
    if value is None or (isinstance(value, (int, float)) and not isinstance(value, bool)):
        return value  # csv writes a float by repr: read back, it is the same
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, datetime):
        return value.isoformat()
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return FORMULA_START.sub("'", text)


def format_cells(rows: Iterable[Sequence[Any]]) -> Iterator[list[Any]]:
    """Return rows as they are written to a file."""
    return ([format_cell(value) for value in row] for row in rows)
