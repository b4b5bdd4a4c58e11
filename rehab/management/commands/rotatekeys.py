"""`manage.py rotatekeys`: new keys of this server, for all that is encrypted with the old ones."""

from __future__ import annotations

import time
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from cryptography.fernet import InvalidToken
from django.apps import apps
from django.conf import settings
from django.core.management import BaseCommand, CommandError

from rehab.exports.clinic.row_serialization import ENCRYPTED
from rehab.exports.encryption import InvalidKey, read_recipients
from rehab.management.files import read_key_file
from rehab.people.server_keys import Purpose, ServerKey, add_key, close_keys_again, encrypt_again
from rehab.people.sign_in.factors.factors import Authenticator

SETTLES_S = 5.0  # a page that read the old key has stored by then what it encrypted with it


class Command(BaseCommand):
    """Encrypts everything again while sessions go on. Run again, it goes on where it ended."""

    help = "Encrypt the secrets of studies and authenticators with new keys, and those anew."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the option of the backup's secret key."""
        parser.add_argument(
            "--key",
            type=Path,
            metavar="KEYFILE",
            help="the backup's secret key, where GARRY_SECRET_KEY was lost",
        )

    def handle(self, *args: Any, key: Path | None, **options: Any) -> None:
        """Rotate the keys. Raises CommandError, with the cure."""
        try:
            recipients = read_recipients(settings.BACKUP_KEYS) if settings.BACKUP_KEYS else []
        except InvalidKey as problem:
            raise CommandError(f"GARRY_BACKUP_KEYS: {problem}") from problem
        closed = close_keys_again(recipients, read_key_file(key) if key else ())
        if closed:
            raise CommandError(
                f"These keys do not open: {', '.join(map(str, closed))}. Put the GARRY_SECRET_KEY "
                "from before into GARRY_SECRET_KEY_FALLBACKS, or name the backup's secret key: "
                "--key KEYFILE."
            )
        for label, (column, purpose) in ENCRYPTED.items():
            self._rotate(label, column, purpose, recipients)
        if not recipients:
            self.stdout.write("Without GARRY_BACKUP_KEYS, losing GARRY_SECRET_KEY loses them.")
        self.stdout.write("All is done. Unset GARRY_SECRET_KEY_FALLBACKS.")

    def _rotate(self, label: str, column: str, purpose: Purpose, recipients: Any) -> None:
        keys = ServerKey.objects.filter(purpose=purpose)
        if keys.count() == 1:  # else a run before did not come to its end
            add_key(purpose, recipients)
        newest = max(keys.values_list("number", flat=True))
        count, _ = _encrypt_rows(label, column, purpose)
        time.sleep(SETTLES_S)
        more, closed = _encrypt_rows(label, column, purpose)
        keys.filter(number__lt=newest).delete()
        self.stdout.write(f"{purpose}: {count + more} encrypted again.")
        if closed:
            self.stderr.write(f"{purpose}: {len(closed)} open with no key of today: {closed[:9]}.")


def _encrypt_rows(label: str, column: str, purpose: Purpose) -> tuple[int, list[int]]:
    """Encrypt the rows that are not yet with the newest key, each by itself.

    Return how many, and the keys of those that do not open.
    """
    count, closed = 0, []
    rows = apps.get_model(label)._base_manager.exclude(**{column: ""})
    if label == Authenticator._meta.label_lower:
        rows = rows.filter(kind=Authenticator.Kind.APP)
    for pk, old in rows.order_by("pk").values_list("pk", column).iterator():
        try:
            new = encrypt_again(purpose, old)
        except InvalidToken:
            closed.append(pk)
            continue
        if new is not None:  # what was changed meanwhile is with the newest key already
            count += rows.filter(**{"pk": pk, column: old}).update(**{column: new})
    return count, closed
