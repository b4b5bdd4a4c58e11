"""A study's own files in an export: enough to analyze it again, and to check its allocation.

Everybody who was ever allocated has a row, walked, gone or removed: without the pseudonym of
those whose data were removed, or whom the account may not see (any more). Groups are empty until
the study is closed.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from django.utils.translation import override

from rehab.exports.archive import write_csv
from rehab.exports.research.dates import shift_of
from rehab.people.models import User
from rehab.studies import analysis
from rehab.studies.agreements import agreement_rows
from rehab.studies.models import Study, StudyMark, StudyState, has_mark
from rehab.studies.participants import Enrollment
from rehab.studies.record.adverse_events import listing_rows
from rehab.studies.record.checklists import checklist_rows
from rehab.studies.registration.protocol_json import write_json
from rehab.studies.results.drawing import TABLES, write_table
from rehab.studies.results.results import read_results
from rehab.studies.results.tables import HEADERS

PARTICIPANTS = (
    *("number", "participant", "pseudonym", "levels", "group", "version"),
    *("enrolled_at", "withdrawn_at", "data_kept"),
)
HERE = Path(__file__).parent
VERIFIER = HERE / "verify_allocation.py"
# What `reanalyze.py` computes with: GARRY's own model, as it is.
MODEL = ("comparison", "design_matrix", "mixed_model", "sequential", "tipping_point")
PACKAGE = "garry_analysis"
DATED = re.compile(r"\d{4}-\d{2}-\d{2}")


def studies_of(user: User, code: str) -> list[Study]:
    """Return the studies that an export tells of: the one of a short name, or all.

    Drafts are left out, and running studies in which the account assesses.
    """
    studies = Study.objects.visible_to(user).exclude(state=StudyState.DRAFT).order_by("pk")
    named = studies.filter(code=code) if code else studies
    return [
        study
        for study in named
        if study.closed_at or not has_mark(study, user, StudyMark.Task.ASSESSOR)
    ]


def study_files(
    user: User, study: Study, now: datetime, *, shift_dates: bool
) -> Iterator[tuple[str, Any]]:
    """Yield a study's files: name and content in pieces."""
    folder = f"studies/{study.code}"
    yield f"{folder}/protocol.json", [write_json(study, has_dates=not shift_dates)]
    rows = participant_rows(user, study, shift_dates=shift_dates)
    yield f"{folder}/participants.csv", write_csv(PARTICIPANTS, rows)
    definitions = [one.to_row() for one in study.outcomes.values()]
    yield f"{folder}/definitions.csv", [write_table(definitions)]
    results = read_results(study, now) if study.state == StudyState.CLOSED else None
    if results is not None:
        yield f"{folder}/verify_allocation.py", [VERIFIER.read_text("utf-8")]
        for name, text in analysis_files():
            yield f"{folder}/{name}", [text]
        yield (
            f"{folder}/adverse_events.csv",
            [write_table(listing_rows(study, by_arm=True), HEADERS["adverse_events"])],
        )
        yield f"{folder}/agreements.csv", [write_table(agreement_rows(study))]
        for name, table in TABLES.items():
            cells, header = table(results), HEADERS.get(name, ())
            if shift_dates:
                cells = ({key: row[key] for key in row if key != "at"} for row in cells)
                header = tuple(key for key in header if key != "at")
            yield f"{folder}/{name}.csv", [write_table(cells, header)]
    with override("en"):
        lists = list(checklist_rows(study, results))
    if shift_dates:  # dates of the study tell those of people
        lists = [row | {"answer": DATED.sub("(date)", row["answer"])} for row in lists]
    yield f"{folder}/checklists.csv", [write_table(lists)]


def analysis_files() -> Iterator[tuple[str, str]]:
    """Yield the scripts that compute a study's results again: name and text."""
    yield "reanalyze.R", (HERE / "reanalyze.R").read_text("utf-8")
    own = Path(analysis.__file__).parent
    modules = [HERE / "reanalyze.py", *(own / f"{name}.py" for name in MODEL)]
    for module in modules:
        text = module.read_text("utf-8").replace(analysis.__name__, PACKAGE)
        yield (module.name if module.parent == HERE else f"{PACKAGE}/{module.name}"), text


def participant_rows(user: User, study: Study, *, shift_dates: bool) -> Iterator[tuple[Any, ...]]:
    """Yield the cells of `PARTICIPANTS` of everybody who was ever allocated, in their order."""
    related = ("patient", "allocation", "version")
    enrollments = Enrollment.everywhere.filter(study=study).select_related(*related)
    seen = set(Enrollment.objects.visible_to(user).filter(study=study).values_list("pk", flat=True))
    is_closed = study.state == StudyState.CLOSED
    for number, one in enumerate(enrollments.order_by("allocation__pk"), start=1):
        pseudonym = one.patient.pseudonym if one.is_analyzed and one.pk in seen else ""
        shift = shift_of(one.patient.pseudonym) if shift_dates else timedelta()
        yield (
            number,
            one.code,
            pseudonym,
            json.dumps(one.levels, ensure_ascii=False),
            one.allocation.group if is_closed else "",
            one.version.number,
            one.enrolled_at + shift,
            one.withdrawn_at and one.withdrawn_at + shift,
            one.keep_data,
        )


def groups_of(user: User, studies: list[Study]) -> dict[str, dict[str, str]]:
    """Return each participant's studies, codes and groups (of closed ones), by pseudonym."""
    found: dict[str, dict[str, str]] = {}
    for study in studies:
        for row in participant_rows(user, study, shift_dates=False):
            about = dict(zip(PARTICIPANTS, row, strict=True))
            of_person = found.setdefault(about["pseudonym"], {})
            cells = {
                "study": study.code,
                "participant": about["participant"],
                "group": about["group"],
            }
            for name, cell in cells.items():
                of_person[name] = " ".join(filter(None, (of_person.get(name), cell)))
    found.pop("", None)
    return found
