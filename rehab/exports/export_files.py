"""The files of exports: everything stored of one patient, or all sessions that a user may see."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from itertools import chain
from typing import Any

from django.db.models import F
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.boards.cache import read_lists
from rehab.boards.models import Leaderboard
from rehab.boards.snapshots import shared_boards
from rehab.exports.archive import write_csv, write_json
from rehab.exports.codebook import CODEBOOK, TABLES, codebook_rows
from rehab.exports.selection import Selection
from rehab.patients.family import FamilyLink
from rehab.patients.visits import Visit
from rehab.people.audit.history import HistoryEntry
from rehab.people.consent.models import Consent
from rehab.people.field_policy import describe
from rehab.people.models import Patient, User
from rehab.sessions.assessment_results import Assessment
from rehab.sessions.models import TrainingSession
from rehab.studies.participants import Enrollment, Screening
from rehab.studies.record.adverse_events import AdverseEvent
from rehab.training.scoring import RULES_VERSION

FILES = {
    "README.txt": _("this page"),
    "patient.json": _("who it is, and how the pages are set"),
    "consent.json": _("what was agreed to, in which words, and when"),
    "visits.json": _("the days on which a visit is or was planned"),
    "tests.json": _("results of standard tests, also those struck out"),
    "family.json": _("which links a family was given, and how often they were opened"),
    "boards.json": _("the rows on leaderboards, and the groups of boards"),
    "studies.json": _("participation in studies; the arm once a study is closed"),
    "changes.json": _("when details were changed, each with its value before and after"),
    **{table.file: table.title for table in TABLES},
    "codebook.csv": _("what every column means, with its unit"),
}
README_TEXT = _("""\
The tables open in any spreadsheet, R or Python: text in UTF-8, commas between cells, the names of
the columns in the first line, an empty cell where there is nothing. Times are in UTC. Numbers have
a decimal point and all their digits: read back, they are what GARRY computes with.

Where a spreadsheet could take text for a formula it has a ' before it: at its beginning and behind
each semicolon, tab and line end. So has a ' that stands there. Take one ' off to get what was
written.

A step's verdict follows from rules that have versions; the newest here is %(version)d. The column
rules_version of steps.csv says which one judged each step.

This is health data. Keep it where only those who need it can open it, and delete it when nobody
does.
""")


def patient_files(user: User, patient: Patient, now: datetime) -> Iterator[tuple[str, Any]]:
    """Return the files with everything stored of one patient, including the name."""
    title = gettext("Everything that GARRY stores about %(patient)s") % {"patient": patient}
    # Translated now: the rest is written while it is sent, after the request's language has ended.
    readme = write_readme(title, list(FILES), now)
    return chain([("README.txt", [readme])], _patient_tables(user, patient, now))


def _patient_tables(user: User, patient: Patient, now: datetime) -> Iterator[tuple[str, Any]]:
    sessions = TrainingSession.objects.visible_to(user).filter(patient=patient)
    yield "patient.json", write_json(describe(patient))
    yield "consent.json", write_json(list_consents(user, patient))
    yield "visits.json", write_json(list_visits(user, patient))
    yield "tests.json", write_json(list_assessments(user, patient))
    yield "family.json", write_json(list_family_links(user, patient))
    yield "boards.json", write_json(list_boards(user, patient, now))
    yield "studies.json", write_json(list_studies(user, patient))
    yield "changes.json", write_json(list_changes(user, patient))
    yield from _session_tables(Selection(user, sessions, named=True))


def session_files(user: User, now: datetime) -> Iterator[tuple[str, Any]]:
    """Return the files of all sessions that a user may see, by pseudonyms."""
    sessions = TrainingSession.objects.visible_to(user)
    names = [name for name in FILES if not name.endswith(".json")]
    title = gettext("All sessions of %(clinic)s, by pseudonyms") % {"clinic": user.clinic}
    readme = write_readme(title, names, now)
    return chain(
        [("README.txt", [readme])], _session_tables(Selection(user, sessions, named=False))
    )


def _session_tables(selection: Selection) -> Iterator[tuple[str, Any]]:
    for table in TABLES:
        yield table.file, write_csv(table.header, table.read(selection))
    yield "codebook.csv", write_csv(CODEBOOK, codebook_rows())


def list_consents(user: User, patient: Patient) -> list[dict[str, Any]]:
    """Return what was agreed to, with the words."""
    rows = Consent.objects.visible_to(user).filter(patient=patient).select_related("text")
    return [
        {
            "purpose": row.purpose,
            "level": row.level or None,
            "answer": "no" if row.is_refusal else "yes",
            "given_at": row.given_at,
            "withdrawn_at": row.withdrawn_at,
            "version": row.text and row.text.version,
            "words": row.text and row.text.text,
        }
        for row in rows.order_by("pk")
    ]


def list_assessments(user: User, patient: Patient) -> list[Any]:
    """Return the results of standard tests, also of a patient without a session."""
    rows = Assessment.objects.visible_to(user).filter(patient=patient).order_by("at", "pk")
    return [describe(row) | {"unit": row.definition.unit} for row in rows]


def list_visits(user: User, patient: Patient) -> list[Any]:
    """Return the visits that were planned."""
    return list(Visit.objects.visible_to(user).filter(patient=patient).values("day", "at"))


def list_family_links(user: User, patient: Patient) -> list[Any]:
    """Return the links that the family was given; who gave them is not named."""
    names = {
        "valid_until": F("expires_at"),
        "with_the_nickname": F("shows_name"),
        "last_opened_at": F("opened_at"),
        "times_opened": F("opened"),
    }
    links = FamilyLink.objects.visible_to(user).filter(patient=patient)
    return list(links.values("created_at", "ended_at", **names))


def list_boards(user: User, patient: Patient, now: datetime) -> list[dict[str, Any]]:
    """Return the patient's rows on boards, and the boards whose group the patient is in."""
    boards = shared_boards([patient.clinic_id]).filter(active=True)
    rows = [
        (board, valence, row)
        for board in boards.select_related("clinic")
        for valence, standings in read_lists(board, now).items()
        if (row := standings.find(patient.pk)) is not None
    ]
    grouped = Leaderboard.objects.visible_to(user).filter(group=patient)
    return [
        {
            "board": board.name,
            "feedback_type": valence or None,
            "figure": row.figure,
            "could_be_kept": row.points_at_stake,
        }
        for board, valence, row in rows
    ] + [{"in_the_group_of_the_board": board.name} for board in grouped]


def list_studies(user: User, patient: Patient) -> list[dict[str, Any]]:
    """Return the patient's part in studies: visits, what happened, the arm once it is no secret."""
    rows = Enrollment.objects.visible_to(user).filter(patient=patient).select_related("study")
    return [
        {
            "study": row.study.title,
            "participant": row.code,
            "levels": row.levels,
            "enrolled_at": row.enrolled_at,
            "withdrawn_at": row.withdrawn_at,
            "data_kept_after_withdrawal": row.keep_data,
            "consent_version": row.consent_version,
            "consented_on": row.consented_on,
            "group": row.allocation.group if row.study.closed_at else None,
            "visits": [
                {"day": visit.day, "number": visit.number, "session": visit.session_id}
                for visit in row.visits.all()
            ],
            "events": [{"at": event.at, "what": event.kind} for event in row.events.all()],
            "adverse_events": [
                describe(event)
                for event in AdverseEvent.objects.visible_to(user).filter(enrollment=row)
            ],
        }
        for row in rows.order_by("pk")
    ] + [
        {
            "study": row.study.title,
            "assessed_at": row.at,
            "criteria_not_met": row.unmet,
            "declined": row.declined,
        }
        for row in Screening.objects.visible_to(user)
        .filter(patient=patient)
        .select_related("study")
    ]


def list_changes(user: User, patient: Patient) -> list[Any]:
    """Return the history of the details; erased values are null, and staff is not named."""
    model = Patient.__name__
    changes = HistoryEntry.objects.visible_to(user).filter(model_name=model, object_id=patient.pk)
    return list(changes.order_by("pk").values("at", "kind", before_and_after=F("changes")))


def write_readme(title: str, names: list[str], now: datetime) -> str:
    """Return the text that explains the archive."""
    listed = "\n".join(f"  {name:14} {FILES[name]}" for name in names)
    made = gettext("Made on %(moment)s UTC.") % {"moment": f"{now:%Y-%m-%d %H:%M}"}
    return f"{title}\n{made}\n\n{listed}\n\n{README_TEXT % {'version': RULES_VERSION}}"
