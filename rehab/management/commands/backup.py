"""`manage.py backup`: everything of this installation in one sealed file."""

from __future__ import annotations

import os
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.core.management import BaseCommand, CommandError
from django.utils import timezone

from rehab.exports.backup import write_backup
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.models import Clinic

PASSPHRASE = "GARRY_BACKUP_PASSPHRASE"  # noqa: S105 (the variable's name)
SHORTEST = 16


def find_passphrase() -> str:
    """Give the passphrase of the environment. Raises CommandError, with the cure."""
    passphrase = os.environ.get(PASSPHRASE, "")
    if len(passphrase) < SHORTEST:
        raise CommandError(
            f"A backup holds everything about patients, and only a passphrase opens it. Set "
            f"{PASSPHRASE} to one of {SHORTEST} characters or more, and keep it elsewhere."
        )
    return passphrase


class Command(BaseCommand):
    """Writes a backup while sessions go on."""

    help = f"Write everything into FILE, sealed with the passphrase in {PASSPHRASE}."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Ask where to."""
        parser.add_argument("file", type=Path, metavar="FILE")

    def handle(self, *args: Any, file: Path, **options: Any) -> None:
        """Write it. A file of that name is replaced only by a whole one."""
        passphrase = find_passphrase()
        new = file.with_name(f".{file.name}.new")
        try:
            with os.fdopen(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "wb") as out:
                counts = write_backup(out, passphrase, timezone.now())
                out.flush()
                os.fsync(out.fileno())
            new.replace(file)
        except OSError as problem:
            raise CommandError(
                f"{file} cannot be written ({problem.strerror}). Choose another place."
            ) from problem
        finally:
            new.unlink(missing_ok=True)
        for clinic in Clinic.everywhere.all():
            audit_log.note(Act.BACKUP, None, clinic=clinic.pk, about="manage.py backup")
        size_mb = file.stat().st_size / 1e6
        self.stdout.write(
            f"{file}: {size_mb:.1f} MB, {counts['rehab.patient']} patients, "
            f"{counts['rehab.trainingsession']} sessions, {counts['rehab.step']} steps."
        )
