"""The files of one session of an export: written aside, and there at once when they are whole."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from rehab.exports.codebook import EVENTS, INCIDENTS, TABLES
from rehab.exports.fhir.resources import Pseudonyms, make_bundle
from rehab.exports.research.bids import EventSink, MotionSink
from rehab.exports.research.dates import SINCE_1970_S, shift_of, shift_rows
from rehab.exports.research.recordings import RecordingSink
from rehab.exports.research.robot_motion import RobotMotionSink
from rehab.exports.research.sinks import CsvSink, Sink, available_formats, pump
from rehab.exports.selection import Selection
from rehab.exports.session_table import PARTICIPANT, SESSIONS
from rehab.exports.step_tables import FEEDBACK, STEPS
from rehab.people.models import User
from rehab.sessions.log import Step
from rehab.sessions.models import TrainingSession
from rehab.studies.participants import StudyVisit

STRIDE_TABLES = (STEPS, FEEDBACK)  # also in each of `FORMATS`
KINDS = ("bids", "recordings", "fhir", "robot")  # folders of the export, beside those
ABOUT = "about.json"  # what the whole export needs to know of a part


def write_part(user: User, session: TrainingSession, folder: Path, *, shift_dates: bool) -> None:
    """Write a session's files into a folder that does not exist before they are whole."""
    aside = folder.with_name(folder.name + ".part")
    if aside.exists():  # of an export that was broken off
        shutil.rmtree(aside)
    aside.mkdir(parents=True)
    _write_files(user, session, aside, shift_dates=shift_dates)
    aside.rename(folder)


def _write_files(user: User, session: TrainingSession, aside: Path, *, shift_dates: bool) -> None:
    pseudonym = session.patient.pseudonym
    shift = shift_of(pseudonym) if shift_dates else None
    sessions = TrainingSession.objects.visible_to(user).filter(pk=session.pk)
    selection = Selection(user, sessions, named=False)
    formats = available_formats()
    for name in (*formats, *KINDS):
        (aside / name).mkdir()
    motion = MotionSink(aside / "bids", pseudonym, _label(session), session.measure.unit)
    recording = RecordingSink(
        _of(aside / "recordings", session, "csv"),
        _extras(user, session),
        has_goal=_has_one_goal(user, session),
    )
    more: dict[str, Sequence[Sink]] = {
        STEPS.file: (motion, recording),
        EVENTS.file: (EventSink(motion),),
    }
    for table in TABLES:  # steps come before events, whose times count from the first step
        sinks: list[Sink] = [CsvSink(aside / table.file), *more.get(table.file, ())]
        for name, sink in formats.items() if table in STRIDE_TABLES else ():
            place = aside / name / table.file.removesuffix(".csv")
            place.mkdir()
            sinks.append(sink(_of(place, session, sink.ending), table))
        rows: Iterable[Any] = shift_rows(table.read(selection), shift)
        if shift is not None and table is STEPS:
            rows = _from_first_step(rows)
        if shift is not None and table is INCIDENTS:
            rows = (row._replace(recording="") for row in rows)  # it may show the time of day
        pump(rows, sinks)
    robot = RobotMotionSink(
        motion,
        _of(aside / "robot", session, "mcap"),
        session.pk,
        hides_clocks=shift is not None,
    )
    pump(shift_rows(INCIDENTS.read(selection), shift), [robot])
    bundle = make_bundle(user, session, Pseudonyms(shift))
    text = json.dumps(bundle, ensure_ascii=False, indent=1)
    _of(aside / "fhir", session, "json").write_text(f"{text}\n", "utf-8")
    about = {"pseudonym": pseudonym, "participant_id": motion.subject if motion.count else ""}
    row = next(SESSIONS.read(selection))
    about |= {column.name: getattr(row, column.name) for column in PARTICIPANT}
    (aside / ABOUT).write_text(json.dumps(about), "utf-8")


def _label(session: TrainingSession) -> str:
    """Return a session as BIDS labels it: by the study's visit, else by its key."""
    visit = StudyVisit.everywhere.filter(session=session).select_related("enrollment__study")
    if (found := visit.first()) is None:
        return str(session.pk)
    label = f"{found.enrollment.study.code}visit{found.number:02}"
    return label if found.attempt == 1 else f"{label}attempt{found.attempt}"


def _of(folder: Path, session: TrainingSession, ending: str) -> Path:
    return folder / f"session-{session.pk}.{ending}"


def _extras(user: User, session: TrainingSession) -> list[str]:
    """Return the names of all further values that the session's source sent."""
    rows = Step.objects.visible_to(user).filter(session=session).exclude(extra={})
    names: dict[str, None] = {}
    for extra in rows.values_list("extra", flat=True).iterator():
        names |= dict.fromkeys(extra)
    return list(names)


def _has_one_goal(user: User, session: TrainingSession) -> bool:
    rows = Step.objects.visible_to(user).filter(session=session).order_by()
    goals = list(rows.values_list("goal", flat=True).distinct()[:2])
    return len(goals) == 1 and goals[0] is not None


def _from_first_step(rows: Iterable[Any]) -> Iterator[Any]:
    """Yield steps whose times reveal no date: a clock since 1970 begins at the first one."""
    origin = None
    for row in rows:
        if origin is None:
            origin = row.time if abs(row.time) >= SINCE_1970_S else 0.0
        yield row._replace(time=row.time - origin) if origin else row
