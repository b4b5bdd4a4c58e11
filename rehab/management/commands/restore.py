"""`manage.py restore`: restore a backup into a new installation."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.core.management import BaseCommand, CommandError, call_command

from rehab.exports.backup import CannotRestore, restore_backup
from rehab.exports.encryption import CannotDecrypt
from rehab.management.files import opened, read_key_file
from rehab.people.commands import command
from rehab.people.server_keys import close_keys_again


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
            help=f"the file with the secret key that `{command('backupkey')}` printed",
        )

    def handle(self, *args: Any, file: Path, key: Path, **options: Any) -> None:
        """Restore the backup. Raises CommandError, with the cure."""
        identities = read_key_file(key)
        call_command("migrate", verbosity=0)
        try:
            with opened(file) as source:
                counts = restore_backup(source, identities)
        except (CannotRestore, CannotDecrypt) as problem:
            raise CommandError(f"{file}: {problem}") from problem
        close_keys_again((), identities)
        self.stdout.write(
            f"{counts['rehab.patient']} patients, {counts['rehab.trainingsession']} sessions and "
            f"{counts['rehab.step']} steps are restored.\nEverybody has to sign in again."
        )
