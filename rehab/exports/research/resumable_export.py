"""An export for analysis, made session by session: it can stop anywhere and goes on from there.

A folder holds ``export.json`` (who asked, for what) and a folder for each session that is whole.
Rights are asked again for every session, when it is written and when it is given out.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple

from django.db.models import QuerySet

from rehab.exports.archive import write_csv
from rehab.exports.codebook import CODEBOOK, TABLES, codebook_rows
from rehab.exports.export_files import README_TEXT
from rehab.exports.research.bids import dataset_files
from rehab.exports.research.jamovi import write_omv
from rehab.exports.research.k_anonymity import write_anonymity
from rehab.exports.research.redcap import COLUMNS, read_rows, redcap_files
from rehab.exports.research.ro_crate import write_crate
from rehab.exports.research.session_files import ABOUT, KINDS, write_part
from rehab.exports.research.sinks import FORMATS, available_formats
from rehab.exports.research.study_files import groups_of, studies_of, study_files
from rehab.people.commands import garry_version
from rehab.people.models import User
from rehab.sessions.models import TrainingSession
from rehab.studies.models import Study
from rehab.studies.participants import StudyVisit
from rehab.training.changes import ENDED_STATES
from rehab.training.scoring import RULES_VERSION

ABOUT_EXPORT = "export.json"
MAX_AGE = timedelta(hours=24)
CHUNK_BYTES = 256 * 1024


class ExportProgress(NamedTuple):
    """How many of the sessions are written."""

    done: int
    total: int

    @property
    def is_done(self) -> bool:
        """Whether all of them are."""
        return self.done == self.total


def sessions_for(user: User, study: Study | None) -> QuerySet[TrainingSession]:
    """Return the ended sessions that a user may export: of a study, or all.

    Those of participants who have left a study, and agreed that its data then go, are not among
    them.
    """
    states = [state.value for state in ENDED_STATES]
    sessions = TrainingSession.objects.visible_to(user).filter(state__in=states)
    left = StudyVisit.everywhere.filter(
        session__isnull=False, enrollment__keep_data=False, enrollment__withdrawn_at__isnull=False
    )
    sessions = sessions.exclude(pk__in=left.values("session"))
    return sessions if study is None else sessions.filter(study_visit__enrollment__study=study)


@dataclass(frozen=True)
class Package:
    """An export in a folder."""

    folder: Path
    user: User
    keys: tuple[int, ...]
    study: str
    shift_dates: bool
    made_at: datetime

    @classmethod
    def create(
        cls, folder: Path, user: User, study: Study | None, *, shift_dates: bool, now: datetime
    ) -> Package:
        """Begin an export in place of whatever the folder holds."""
        if folder.exists():
            shutil.rmtree(folder)
        folder.mkdir(parents=True, mode=0o700)
        keys = sessions_for(user, study).order_by("pk").values_list("pk", flat=True)
        about = {
            "user": user.pk,
            "role": user.role,
            "keys": list(keys),
            "study": study.code if study else "",
            "shift_dates": shift_dates,
            "made_at": now.isoformat(),
        }
        (folder / ABOUT_EXPORT).write_text(json.dumps(about), "utf-8")
        package = cls.find(folder, user, now)
        assert package is not None  # noqa: S101 - written just now
        return package

    @classmethod
    def find(cls, folder: Path, user: User, now: datetime) -> Package | None:
        """Return the export that a user has begun in a folder; None if there is none.

        One that is too old is removed; one of another account, or of a former role, which may have
        seen more, is left alone.
        """
        try:
            about, made_at = _read_about(folder)
            package = cls(
                folder, user, tuple(about["keys"]), about["study"], about["shift_dates"], made_at
            )
        except (OSError, ValueError, KeyError):
            return None
        if (about["user"], about.get("role")) != (user.pk, user.role):
            return None
        if not timedelta() <= now - made_at < MAX_AGE:
            package.discard()
            return None
        return package

    def discard(self) -> None:
        """Remove the files."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _part(self, key: int) -> Path:
        return self.folder / str(key)

    @property
    def progress(self) -> ExportProgress:
        """How far it is."""
        return ExportProgress(sum(self._part(key).is_dir() for key in self.keys), len(self.keys))

    def advance(
        self, seconds: float, clock: Callable[[], float] = time.monotonic
    ) -> Iterator[ExportProgress]:
        """Write sessions until the time is over, one at least; yield the progress after each."""
        until = clock() + seconds
        done, total = self.progress
        for key in self.keys:
            if self._part(key).is_dir():
                continue
            rows = TrainingSession.objects.visible_to(self.user).select_related(
                "patient", "measure"
            )
            session = rows.filter(pk=key).first()
            if session is None:  # it may not be seen any more
                self._part(key).mkdir()
            else:
                write_part(self.user, session, self._part(key), shift_dates=self.shift_dates)
            done += 1
            yield ExportProgress(done, total)
            if clock() >= until:
                return

    def _readable(self) -> dict[int, str]:
        """Return the sessions that may still be given out, with their patients' pseudonyms now."""
        rows = sessions_for(self.user, None).filter(pk__in=self.keys)
        return dict(rows.values_list("pk", "patient__pseudonym"))

    def files(self) -> Iterator[tuple[str, Iterable[str | bytes]]]:
        """Yield the files of the archive: name and content in pieces.

        A session that the user may not see any more, or whose patient was erased, is left out.
        """
        allowed = self._readable()
        studies = studies_of(self.user, self.study)
        groups = groups_of(self.user, studies)
        people: dict[str, dict[str, Any]] = {}
        parts = []
        for key in self.keys:
            about = self._part(key) / ABOUT
            known = json.loads(about.read_text("utf-8")) if about.exists() else {}
            if key in allowed and known.get("pseudonym") == allowed[key]:
                parts.append(self._part(key))
                if known["participant_id"]:
                    about_study = groups.get(known["pseudonym"], {})
                    people.setdefault(known["participant_id"], known | about_study)
        names = []
        for name, content in self._all_files(parts, studies, people):
            names.append(name)
            yield name, content
        what = f"Study {self.study}" if self.study else "All sessions"
        published = f"{self.made_at:%Y}" if self.shift_dates else f"{self.made_at:%Y-%m-%d}"
        crate = write_crate(names, what, published, garry_version())
        yield "ro-crate-metadata.json", [crate]

    def _all_files(
        self, parts: list[Path], studies: list[Study], people: dict[str, dict[str, Any]]
    ) -> Iterator[tuple[str, Iterable[str | bytes]]]:
        """Yield the files of the archive but for what describes them all."""
        yield "README.txt", [self._readme(len(parts))]
        yield "k_anonymity.csv", [write_anonymity(list(people.values()))]
        yield "codebook.csv", write_csv(CODEBOOK, codebook_rows())
        for table in TABLES:
            yield table.file, _concatenate(table.header, [part / table.file for part in parts])
        yield from redcap_files(read_rows(parts))
        yield "jamovi/sessions.omv", [write_omv(COLUMNS, list(read_rows(parts)))]
        for study in studies:
            yield from study_files(self.user, study, self.made_at, shift_dates=self.shift_dates)
        for name, text in dataset_files(people.values(), garry_version()) if people else ():
            yield f"bids/{name}", [text]
        for part in parts:
            for kind in (*FORMATS, *KINDS):
                for file in sorted((part / kind).rglob("*.*")):
                    if file.is_file():
                        yield file.relative_to(part).as_posix(), _read(file)

    def _readme(self, given: int) -> str:
        what = f"study {self.study}" if self.study else "all sessions"
        parquet = (
            "Steps and feedback also as Parquet, a file for each session in one folder for each."
            if "parquet" in available_formats()
            else "No Parquet: the server has no pyarrow (pip install 'garry[parquet]')."
        )
        dates = (
            "Dates are shifted: for each patient by whole weeks that are always the same and that "
            "only the server knows. Texts that people wrote may still name a date."
            if self.shift_dates
            else "Dates are true ones: with a gait they can tell who somebody is."
        )
        return (
            f"GARRY {garry_version()}: {what} by pseudonyms, for analysis\n"
            f"Made from {self.made_at:%Y-%m-%d %H:%M} UTC; {given} of {len(self.keys)} sessions. "
            "Missing ones may not be seen any more.\n\n"
            f"{dates}\n{parquet}\n"
            "recordings/: sessions to play again in GARRY. bids/: BIDS motion, of strides "
            "and of the robot. robot/: how it moved, as MCAP. fhir/: FHIR R4B.\n"
            "study_visits.csv has the allocation of closed studies; of others it is sealed.\n"
            "studies/: a folder for each study: the protocol with all versions, everybody who was "
            "ever allocated, what each outcome means; of closed ones the results' tables, the "
            "seed, verify_allocation.py, which allocates again, reanalyze.py and .R, which "
            "redo the results. checklists.csv: SPIRIT, CONSORT, TIDieR, WHO.\n"
            "redcap/: sessions and visits as a data dictionary and an import; jamovi/: the same.\n"
            "k_anonymity.csv: how many people are alike. ro-crate-metadata.json: RO-Crate 1.1.\n"
            "Sessions of people who left a study and wanted their data removed are not here.\n\n"
            f"{README_TEXT % {'version': RULES_VERSION}}"
        )


def discard_old(folder: Path, now: datetime) -> None:
    """Remove exports that were not fetched within a day."""
    for one in folder.iterdir() if folder.is_dir() else ():
        if one.is_dir() and now - _find_beginning(one) >= MAX_AGE:
            shutil.rmtree(one, ignore_errors=True)


def _find_beginning(folder: Path) -> datetime:
    """Return when an export was begun: as it says, or when its folder was last written to."""
    try:
        return _read_about(folder)[1]
    except (OSError, ValueError, KeyError):
        return datetime.fromtimestamp(folder.stat().st_mtime, UTC)


def _read_about(folder: Path) -> tuple[dict[str, Any], datetime]:
    """Return who asked for an export, for what, and when. Raises OSError, ValueError, KeyError."""
    about = json.loads((folder / ABOUT_EXPORT).read_text("utf-8"))
    return about, datetime.fromisoformat(about["made_at"])


def _concatenate(header: list[str], files: Iterable[Path]) -> Iterator[str | bytes]:
    yield ",".join(header) + "\r\n"
    for file in files:
        yield from _read(file)


def _read(file: Path) -> Iterator[bytes]:
    with file.open("rb") as content:
        while chunk := content.read(CHUNK_BYTES):
            yield chunk
