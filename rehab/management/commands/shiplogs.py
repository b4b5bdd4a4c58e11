"""`manage.py shiplogs`: append what was sealed of the logs to a file stored elsewhere."""

from __future__ import annotations

import json
import os
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.core.management.base import BaseCommand, CommandError
from django.utils import timezone

from rehab.exports.backup import ExactEncoder
from rehab.people.audit.seals import seal_logs, shipped_lines


class Command(BaseCommand):
    """Appends each new seal with its rows to a file, one line of JSON a seal."""

    help = "Seal the logs, and append to FILE what it lacks: a line of JSON for each seal."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the argument FILE."""
        parser.add_argument("file", type=Path, metavar="FILE")

    def handle(self, *args: Any, file: Path, **options: Any) -> None:
        """Append the lines. Only the owner of this process reads the file."""
        seal_logs(timezone.now())
        after, count = _last_seal(file), 0
        try:
            flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND
            descriptor = os.open(file, flags, 0o600)
            with os.fdopen(descriptor, "a", encoding="utf-8") as out:
                os.fchmod(descriptor, 0o600)
                for line in shipped_lines(after):
                    out.write(json.dumps(line, cls=ExactEncoder, ensure_ascii=False) + "\n")
                    count += 1
        except OSError as problem:
            raise CommandError(
                f"{file} cannot be written ({problem.strerror}). Choose another place."
            ) from problem
        self.stdout.write(f"{file}: {count} new seals.")


def _last_seal(file: Path) -> int:
    """Return the key of the last seal in a file; 0 for none. Raises CommandError."""
    last = ""
    if file.exists():
        with file.open(encoding="utf-8") as lines:
            for last in lines:  # noqa: B007
                pass
    try:
        return int(json.loads(last)["seal"]) if last else 0
    except (ValueError, KeyError, TypeError) as problem:
        raise CommandError(f"{file} is not a file of shiplogs. Name another one.") from problem
