"""`manage.py restore`: a backup, taken into a new installation."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.core.management import BaseCommand, CommandError, call_command

from rehab.exports.backup import CannotRestore, restore_backup
from rehab.exports.sealed import CannotUnseal
from rehab.management.commands.backup import PASSPHRASE, find_passphrase


class Command(BaseCommand):
    """Makes the tables, and takes in everything or nothing."""

    help = f"Take FILE into a new installation, opened with the passphrase in {PASSPHRASE}."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Ask where from."""
        parser.add_argument("file", type=Path, metavar="FILE")

    def handle(self, *args: Any, file: Path, **options: Any) -> None:
        """Take it in. Raises CommandError, with the cure."""
        passphrase = find_passphrase()
        call_command("migrate", verbosity=0)
        try:
            with file.open("rb") as source:
                counts = restore_backup(source, passphrase)
        except OSError as problem:
            raise CommandError(f"{file} cannot be read: {problem.strerror}.") from problem
        except (CannotRestore, CannotUnseal) as problem:
            raise CommandError(f"{file}: {problem}") from problem
        self.stdout.write(
            f"{counts['rehab.patient']} patients, {counts['rehab.trainingsession']} sessions and "
            f"{counts['rehab.step']} steps are here. Everybody signs in anew."
        )
