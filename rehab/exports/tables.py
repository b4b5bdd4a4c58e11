"""The tables that are given out: what each column means, and the rows, page by page.

Rows are read in pages by key, so that neither memory nor the database holds more than a page while
a browser is slow. Whose eyes they are for is `visible_to`'s business; `named` says whether they may
hold anything but pseudonyms.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from itertools import islice
from typing import Any, NamedTuple

from django.db.models import QuerySet

from rehab.people.models import User
from rehab.sessions.corrections import SessionCorrection
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.replay import fold_log
from rehab.training.fold import SessionFold
from rehab.training.metrics import METRICS

PAGE = 2_000  # rows held in memory
SESSIONS_PAGE = 200


class Column(NamedTuple):
    """What stands in a column."""

    name: str
    unit: str
    meaning: str


@dataclass(frozen=True)
class Table:
    """A file of rows."""

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
TABLES = (SESSIONS, STEPS, EVENTS, CORRECTIONS)
STEP_FIELDS = (
    *("number", "time_s", "received_at", "side", "value", "gain", "shown", "goal", "performance"),
    *("hit", "points", "valid", "reasons", "phase", "rules_version", "extra"),
)
NUMBER, SIDE, REASONS, PHASE = (
    STEP_FIELDS.index(name) for name in ("number", "side", "reasons", "phase")
)


@dataclass(frozen=True)
class Selection:
    """Sessions as somebody may see them. ``named``: their patients and therapists may be named."""

    user: User
    sessions: QuerySet[TrainingSession]
    named: bool
    keys: list[int] = field(init=False)

    def __post_init__(self) -> None:
        keys = self.sessions.order_by("pk").values_list("pk", flat=True)
        object.__setattr__(self, "keys", list(keys))

    def read_sessions(self) -> Iterator[TrainingSession]:
        """Give the sessions, oldest first."""
        related = ("patient", "measure", "protocol")
        for first in range(0, len(self.keys), SESSIONS_PAGE):
            page = self.keys[first : first + SESSIONS_PAGE]
            yield from self.sessions.filter(pk__in=page).select_related(*related).order_by("pk")

    def _with_figures(self) -> Iterator[tuple[TrainingSession, dict[str, float]]]:
        """Give the sessions with their figures, which are read for a page at once."""
        sessions = self.read_sessions()
        while page := list(islice(sessions, SESSIONS_PAGE)):
            figures: dict[int, dict[str, float]] = {session.pk: {} for session in page}
            found = SessionMetric.objects.visible_to(self.user).filter(session__in=list(figures))
            for key, slug, value in found.values_list("session_id", "slug", "value"):
                figures[key][slug] = value
            yield from ((session, figures[session.pk]) for session in page)

    def session_rows(self) -> Iterator[tuple[Any, ...]]:
        """Give the rows of ``SESSIONS``."""
        for session, figures in self._with_figures():
            target = session.plan["target"]
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
                target["hit_rate"],
                target["duration_s"],
                session.active_s,
                session.protocol and session.protocol.name,
                session.plan["activation_threshold"],
                session.simulated,
                session.legacy_id is not None,
                session.source if self.named else "",
                *(figures.get(slug) for slug in METRICS),
            )

    def step_rows(self) -> Iterator[tuple[Any, ...]]:
        """Give the rows of ``STEPS``."""
        steps = Step.objects.visible_to(self.user).order_by("number")
        for session in self.read_sessions():
            known = [
                (phase["kind"], phase["name"], phase["feedback"])
                for phase in session.plan["phases"]
            ]
            head = (session.pk, session.patient.pseudonym)
            types = _types_of(session)
            for step in _pages(steps.filter(session=session), STEP_FIELDS, "number"):
                *row, version, extra = step
                trained = row[SIDE] == session.trained_side
                row[REASONS] = " ".join(row[REASONS])
                row.insert(SIDE + 1, trained)
                phase = known[step[PHASE]]
                *_, feedback = phase
                kind = next(slug for after, slug in types if after < step[NUMBER])
                yield (*head, *row, *phase, kind if feedback else "", version, extra or None)

    def event_rows(self) -> Iterator[tuple[Any, ...]]:
        """Give the rows of ``EVENTS``."""
        names = ("pk", "at", "after_number", "kind", "old", "value", "by__username", "data")
        events = SessionEvent.objects.visible_to(self.user).order_by("pk")
        for session in self.read_sessions():
            head = (session.pk, session.patient.pseudonym)
            for _, *row, by, data in _pages(events.filter(session=session), names, "pk"):
                who = by if self.named or not by else "person"
                yield (*head, *row, who, data or None)

    def correction_rows(self) -> Iterator[tuple[Any, ...]]:
        """Give the rows of ``CORRECTIONS``."""
        names = ("pk", "at", "field", "old", "new", "reason", "by__username")
        corrections = SessionCorrection.objects.visible_to(self.user).order_by("pk")
        for session in self.read_sessions():
            head = (session.pk, session.patient.pseudonym)
            for _, *row, by in _pages(corrections.filter(session=session), names, "pk"):
                yield (*head, *row, by if self.named or not by else "person")

    def read(self, table: Table) -> Iterator[tuple[Any, ...]]:
        """Give a table's rows."""
        rows = {
            SESSIONS.file: self.session_rows,
            STEPS.file: self.step_rows,
            EVENTS.file: self.event_rows,
            CORRECTIONS.file: self.correction_rows,
        }
        return rows[table.file]()


def _types_of(session: TrainingSession) -> list[tuple[int, str]]:
    """Give after which step which feedback type was in force, the last one first."""
    if not session.changed_to:
        return [(-1, session.valence)]
    switches = fold_log(SessionFold(session.to_plan()), session).switches
    return [*reversed(switches), (-1, session.valence)]


def _pages(rows: QuerySet[Any], names: Sequence[str], key: str) -> Iterator[tuple[Any, ...]]:
    """Give values of rows, which are ordered by a key that each has alone."""
    place, after = names.index(key), None
    while True:
        rest = rows if after is None else rows.filter(**{f"{key}__gt": after})
        page = list(rest.values_list(*names)[:PAGE])
        yield from page
        if len(page) < PAGE:
            return
        after = page[-1][place]


def codebook() -> Iterator[tuple[str, ...]]:
    """Give what every column of every table means."""
    for table in TABLES:
        yield from ((table.file, *column) for column in table.columns)


def to_cell(value: Any) -> Any:
    """Give a value as it stands in a file: floats exact, and text that no spreadsheet runs.

    A text that a spreadsheet could take for a formula gets a ' before it, and so does one that
    begins with ': taking one ' off gives back what was there.
    """
    if value is None or (isinstance(value, (int, float)) and not isinstance(value, bool)):
        return value  # csv writes a float by repr: read back, it is the same
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, datetime):
        return value.isoformat()
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r", "\n", "'")) else text


def to_cells(rows: Iterable[Sequence[Any]]) -> Iterator[list[Any]]:
    """Give rows as they stand in a file."""
    return ([to_cell(value) for value in row] for row in rows)
