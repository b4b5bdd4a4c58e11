"""`manage.py retention`: erase patients and logs past their retention period, every night."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.conf import settings
from django.core.management.base import BaseCommand
from django.db import transaction
from django.utils import timezone

from rehab.boards.cache_invalidation import delete_old_changes
from rehab.exports.research.resumable_export import discard_old
from rehab.patients.closure import SessionStillOpen
from rehab.patients.erasure import erase
from rehab.patients.retention import delete_old_logs, patients_past_retention
from rehab.people.models import Clinic, ErasureReason
from rehab.sessions.setup.recordings import discard_old_uploads


class Command(BaseCommand):
    """Erases patients and deletes old log entries by each clinic's own periods."""

    help = "Erase patients and logs that clinics have kept for as long as they set in the admin."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the options."""
        parser.add_argument(
            "--dry-run", action="store_true", help="list whom it would erase, and change nothing"
        )

    def handle(self, *args: Any, dry_run: bool, **options: Any) -> None:
        """Erase, and print how many. Patients with an open session are named and skipped."""
        now = timezone.now()
        for clinic in Clinic.everywhere.order_by("pk"):
            erased = 0
            for patient in patients_past_retention(clinic, now):
                if dry_run:
                    self.stdout.write(f"{clinic}: would erase {patient.code}")
                    continue
                try:
                    erase(patient, ErasureReason.RETENTION, None, now)
                    erased += 1
                except SessionStillOpen as problem:
                    self.stderr.write(f"{clinic}, {patient.code}: {problem}")
            with transaction.atomic():
                deleted = delete_old_logs(clinic, now)
                transaction.set_rollback(dry_run)
            action = "would delete" if dry_run else "deleted"
            self.stdout.write(
                f"{clinic}: {erased} patient(s) erased, {action} {deleted} log entries."
            )
        if not dry_run:
            discard_old(Path(settings.DATA_DIR) / "exports", now)
            discard_old_uploads(now)
            delete_old_changes(now)
        if dry_run:
            self.stdout.write("Nothing was changed (--dry-run).")
