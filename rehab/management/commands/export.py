"""`manage.py export`: the same files as the pages' exports, for scripts and very large ones."""

from __future__ import annotations

import os
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.core.management.base import BaseCommand, CommandError
from django.utils import timezone

from rehab.exports.archive import write_zip
from rehab.exports.patient_data import patient_files, session_files
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.models import Patient, User


class Command(BaseCommand):
    """Writes all sessions that an account may see, or all data of one patient."""

    help = "Write FILE (a ZIP): all sessions that an account may see, or one patient's data."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the options."""
        parser.add_argument("file", type=Path, metavar="FILE")
        parser.add_argument("--as", dest="username", required=True, metavar="ACCOUNT")
        parser.add_argument("--patient", metavar="CODE", help="all of this patient, with the name")

    def handle(
        self, *args: Any, file: Path, username: str, patient: str | None, **options: Any
    ) -> None:
        """Write the file, readable only by the owner of this process."""
        user = User.everywhere.select_related("clinic").filter(username=username).first()
        if user is None or user.clinic is None:
            raise CommandError(f"No clinic's account is called {username!r}. Look in the admin.")
        now, patient_id = timezone.now(), None
        files = session_files(user, now)
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
            about=f"manage.py export --as {username}",
            now=now,
        )
        try:
            descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
            with os.fdopen(descriptor, "wb") as out:
                os.fchmod(descriptor, 0o600)  # also a file that was there with other rights
                for part in write_zip(files):
                    out.write(part)
        except OSError as problem:
            raise CommandError(
                f"{file} cannot be written ({problem.strerror}). Choose another place."
            ) from problem
        self.stdout.write(f"{file}: {file.stat().st_size / 1e6:.1f} MB.")
