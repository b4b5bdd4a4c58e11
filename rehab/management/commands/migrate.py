"""`manage.py migrate`: Django's command, which refuses databases of development versions."""

from __future__ import annotations

from typing import Any

from django.core.management.commands import migrate
from django.db import connections

from rehab.people.sign_in.first_start import refuse_development_database


class Command(migrate.Command):
    """Applies migrations, except to a database made by a development version."""

    def handle(self, *args: Any, **options: Any) -> None:
        """Migrate. Raises CommandError, with the cure, where that cannot be done."""
        refuse_development_database(options["database"])
        connection = connections[options["database"]]
        if connection.vendor == "postgresql":  # an index of a large table takes its time
            with connection.cursor() as cursor:
                cursor.execute("SET statement_timeout = 0")
        super().handle(*args, **options)
