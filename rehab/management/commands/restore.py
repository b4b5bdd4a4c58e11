"""`manage.py restore`: restore a backup into a new installation."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.core.management import BaseCommand, CommandError, call_command

from rehab.exports.backup import CannotRestore, restore_backup
from rehab.exports.encryption import CannotDecrypt, InvalidKey, read_identities


class Command(BaseCommand):
    """Creates the tables, and restores everything or nothing."""

    help = "Restore FILE into a new installation, decrypted with a secret key."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the arguments."""
        parser.add_argument("file", type=Path, metavar="FILE")
        parser.add_argument(
            "--key",
            type=Path,
            required=True,
            metavar="KEYFILE",
            help="the file with the secret key that `manage.py backupkey` printed",
        )

    def handle(self, *args: Any, file: Path, key: Path, **options: Any) -> None:
        """Restore the backup. Raises CommandError, with the cure."""
        try:
            identities = read_identities(key.read_text())
        except OSError as problem:
            raise CommandError(f"{key} cannot be read: {problem.strerror}.") from problem
        except ValueError as problem:  # InvalidKey, or no text at all
            cure = problem if isinstance(problem, InvalidKey) else "It is no text file."
            raise CommandError(f"{key}: {cure}") from problem
        call_command("migrate", verbosity=0)
        try:
            with file.open("rb") as source:
                counts = restore_backup(source, identities)
        except OSError as problem:
            raise CommandError(f"{file} cannot be read: {problem.strerror}.") from problem
        except (CannotRestore, CannotDecrypt) as problem:
            raise CommandError(f"{file}: {problem}") from problem
        self.stdout.write(
            f"{counts['rehab.patient']} patients, {counts['rehab.trainingsession']} sessions and "
            f"{counts['rehab.step']} steps are restored. Everybody has to sign in again."
        )
