"""`manage.py backupkey`: a new pair of keys for backups."""

from __future__ import annotations

from typing import Any

from django.core.management import BaseCommand

from rehab.exports.encryption import generate_key


class Command(BaseCommand):
    """Prints a new pair of keys. Nothing is stored."""

    help = "Print a new pair of keys: a public one to make backups, a secret one to restore them."

    def handle(self, *args: Any, **options: Any) -> None:
        """Print a key file, with comments about where to keep each key."""
        secret, public = generate_key()
        self.stdout.write(
            "# Print this page or keep it on a stick, away from the server: without it no backup "
            "can be opened.\n"
            f"# For a clinic that is to move here: clinic export … --to {public}\n"
            f"# On a server that makes backups: GARRY_BACKUP_KEYS={public}\n"
            f"{secret}"
        )
