"""`manage.py import_garry`: import participants and sessions from the original GARRY."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.core.management import BaseCommand, CommandError
from django.db import transaction

from rehab.legacy.database import InvalidDatabase, read_database
from rehab.legacy.importing import Importer
from rehab.people.models import Clinic
from rehab.people.sign_in.first_start import first_clinic, prepare_database


class Command(BaseCommand):
    """Imports everything, or else nothing (``--partial``: what it can); always says why."""

    help = "Import participants and sessions of an original GARRY (data.db). Again, only new ones."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the options."""
        parser.add_argument("file", type=Path, metavar="FILE")
        parser.add_argument("--dry-run", action="store_true", help="report, and change nothing")
        parser.add_argument(
            "--partial", action="store_true", help="leave out rows that cannot be taken over"
        )
        parser.add_argument("--clinic", metavar="NAME", help="whose they are, if there are several")

    def handle(self, *args: Any, **options: Any) -> None:
        """Import. Raises CommandError, with the cure, where nothing was changed."""
        try:
            database = read_database(options["file"])
        except InvalidDatabase as problem:
            raise CommandError(f"{problem} Nothing was changed.") from problem
        prepare_database()
        with transaction.atomic():
            importer = Importer(find_clinic(options["clinic"]), database)
            importer.run()
            keep = importer.is_complete or options["partial"]
            if options["dry_run"] or not keep:
                transaction.set_rollback(True)
        self.stdout.write("\n".join(importer.report()))
        if not keep:
            raise CommandError(
                "Nothing was changed, since not all could be taken over. Mend that, or take over "
                "the rest with --partial."
            )
        self.stdout.write("Nothing was changed (--dry-run)." if options["dry_run"] else "Done.")


def find_clinic(name: str | None) -> Clinic:
    """Return the clinic of this name, or the only one. Raises CommandError."""
    names = list(Clinic.everywhere.values_list("name", flat=True))
    if name is None and len(names) <= 1:
        return first_clinic()
    if name not in names:
        problem = "Which clinic?" if name is None else f"There is no clinic {name!r}."
        raise CommandError(f"{problem} Give --clinic with one of: {', '.join(names) or '(none)'}.")
    return Clinic.everywhere.get(name=name)
