"""`manage.py backup`: everything of this installation in one encrypted file."""

from __future__ import annotations

from argparse import ArgumentParser
from datetime import datetime
from pathlib import Path
from typing import Any

from django.conf import settings
from django.core.management import BaseCommand, CommandError
from django.utils import timezone

from rehab.exports.backup import write_backup
from rehab.exports.encryption import InvalidKey, read_recipients
from rehab.management.files import new_file
from rehab.outbox.models import Topic, notify
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.commands import command
from rehab.people.models import Clinic
from rehab.people.server_keys import close_keys_again


class Command(BaseCommand):
    """Writes a backup while sessions go on."""

    help = "Write everything into FILE, encrypted to the public keys in GARRY_BACKUP_KEYS."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the argument FILE."""
        parser.add_argument("file", type=Path, metavar="FILE")

    def handle(self, *args: Any, file: Path, **options: Any) -> None:
        """Write the backup. An existing file is replaced only by a complete one."""
        now = timezone.now()
        try:
            counts = _write(file, now)
        except Exception as problem:
            for clinic in Clinic.everywhere.all():
                notify(clinic.pk, Topic.BACKUP, {"problem": type(problem).__name__}, now)
            raise
        for clinic in Clinic.everywhere.all():
            audit_log.record(
                Act.BACKUP, None, clinic_id=clinic.pk, about=command("backup"), now=now
            )
        size_mb = file.stat().st_size / 1e6
        self.stdout.write(
            f"{file}: {size_mb:.1f} MB, {counts['rehab.patient']} patients, "
            f"{counts['rehab.trainingsession']} sessions, {counts['rehab.step']} steps."
        )


def _write(file: Path, now: datetime) -> dict[str, int]:
    """Write the backup; return how many rows of each model it has. Raises CommandError."""
    try:
        recipients = read_recipients(settings.BACKUP_KEYS)
    except InvalidKey as problem:
        raise CommandError(
            "A backup holds everything about patients, and is encrypted to a public key in "
            f"GARRY_BACKUP_KEYS. {problem}"
        ) from problem
    close_keys_again(recipients)
    with new_file(file) as out:
        return write_backup(out, recipients, now)
