"""`manage.py migrate`: Django's command, which refuses databases of development versions."""

from __future__ import annotations

from typing import Any

from django.core.management.commands import migrate

from rehab.people.sign_in.first_start import refuse_development_database


class Command(migrate.Command):
    """Applies migrations, except to a database made by a development version."""

    def handle(self, *args: Any, **options: Any) -> None:
        """Migrate. Raises CommandError, with the cure, where that cannot be done."""
        refuse_development_database(options["database"])
        super().handle(*args, **options)
