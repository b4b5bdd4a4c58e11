"""`manage.py export`: the same files as the pages' exports, for scripts and very large ones."""

from __future__ import annotations

import math
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.core.management.base import BaseCommand, CommandError
from django.utils import timezone

from rehab.exports.archive import Files, save_zip
from rehab.exports.export_files import patient_files, session_files
from rehab.exports.research.resumable_export import Package
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.commands import command
from rehab.people.models import Patient, User
from rehab.studies.models import Study


class Command(BaseCommand):
    """Writes all sessions that an account may see, or all data of one patient."""

    help = "Write FILE (a ZIP): all sessions that an account may see, or one patient's data."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the options."""
        parser.add_argument("file", type=Path, metavar="FILE")
        parser.add_argument("--as", dest="username", required=True, metavar="ACCOUNT")
        parser.add_argument("--patient", metavar="CODE", help="all of this patient, with the name")
        parser.add_argument(
            "--research",
            action="store_true",
            help="for analysis: also Parquet, BIDS, FHIR, recordings; goes on where it was stopped",
        )
        parser.add_argument("--study", metavar="NAME", help="with --research: of this study alone")
        parser.add_argument("--shift-dates", action="store_true", help="with --research")

    def handle(
        self,
        *args: Any,
        file: Path,
        username: str,
        patient: str | None,
        research: bool,
        study: str | None,
        shift_dates: bool,
        **options: Any,
    ) -> None:
        """Write the file, readable only by the owner of this process."""
        user = User.everywhere.select_related("clinic").filter(username=username).first()
        if user is None or user.clinic is None:
            raise CommandError(f"No clinic's account is called {username!r}. Look in the admin.")
        now, patient_id = timezone.now(), None
        if ((study or shift_dates) and not research) or (research and patient):
            raise CommandError("--study and --shift-dates go with --research, --patient does not.")
        package = self._find_package(file, user, study, shift_dates) if research else None
        files: Files = session_files(user, now) if package is None else package.files()
        if patient is not None:
            row = Patient.objects.visible_to(user).filter(code=patient).first()
            if row is None:
                raise CommandError(f"{username} sees no patient with the code {patient!r}.")
            files, patient_id = patient_files(user, row, now), row.pk
        audit_log.record(
            Act.EXPORT,
            None,
            clinic_id=user.clinic_id,
            patient_id=patient_id,
            about=command(f"export --as {username}"),
            now=now,
        )
        if package is not None:
            self._prepare(package)
        try:
            save_zip(files, file)
        except OSError as problem:
            raise CommandError(
                f"{file} cannot be written ({problem.strerror}). Choose another place."
            ) from problem
        if package is not None:
            package.discard()
        self.stdout.write(f"{file}: {file.stat().st_size / 1e6:.1f} MB.")

    def _find_package(
        self, file: Path, user: User, study: str | None, shift_dates: bool
    ) -> Package:
        """Return the export beside a file that was stopped, or a new one."""
        now, folder = timezone.now(), file.with_name(file.name + ".parts")
        row = None
        if study is not None:
            row = Study.objects.visible_to(user).filter(code=study).first()
            if row is None:
                raise CommandError(f"{user} sees no study {study!r}. Give its short name.")
        begun = Package.find(folder, user, now)
        if begun and (begun.study, begun.shift_dates) == (study or "", shift_dates):
            self.stderr.write(f"{folder}: goes on after {begun.progress.done} sessions.")
            return begun
        if begun is None and folder.exists() and any(folder.iterdir()):
            raise CommandError(f"{folder} holds something else. Move it, or name another file.")
        try:
            return Package.create(folder, user, row, shift_dates=shift_dates, now=now)
        except OSError as problem:
            raise CommandError(
                f"{folder} cannot be written ({problem.strerror}). Choose another place."
            ) from problem

    def _prepare(self, package: Package) -> None:
        """Write all sessions, and tell how far it is."""
        for done, total in package.advance(math.inf):
            self.stderr.write(f"\r{done} / {total} sessions", ending="")
        self.stderr.write("")
