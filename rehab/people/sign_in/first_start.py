"""What a new machine needs before it can serve: tables, a clinic, and someone who may sign in."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from django.conf import settings
from django.core.management import CommandError, call_command
from django.db import DatabaseError, connection, transaction
from django.db.migrations.executor import MigrationExecutor

from rehab.people.models import UNAMBIGUOUS, Clinic, User
from rehab.people.roles import Role

FIRST_USERNAME = "pt"
FIRST_CLINIC = "My clinic"


def prepare_database() -> None:
    """Bring the tables up to date: by itself on one machine, by hand on a hosted server.

    Raises CommandError, with the cure, where the database cannot be reached or is not up to date.
    """
    try:
        executor = MigrationExecutor(connection)
        pending = executor.migration_plan(executor.loader.graph.leaf_nodes())
    except DatabaseError as problem:
        raise CommandError(
            f"The database cannot be reached: {problem}. Check GARRY_DATABASE_URL."
        ) from problem
    if not pending:
        return
    if settings.HOSTED:
        raise CommandError(
            f"The database lacks {len(pending)} migration(s). Back it up, then run "
            "`manage.py migrate`."
        )
    call_command("migrate", verbosity=0, interactive=False)


def first_clinic() -> Clinic:
    """Give the clinic of a machine that serves only one; made on first use."""
    return Clinic.everywhere.order_by("pk").first() or Clinic.everywhere.create(name=FIRST_CLINIC)


def first_password() -> str | None:
    """Give the first account's password for as long as it is still the one that was generated.

    Makes clinic and account where nobody has an account yet. The password stands in a file that
    only the server's user can read, until someone changes it.
    """
    file: Path = settings.DATA_DIR / "first_password"
    if not User.everywhere.exists():
        password = "-".join(
            "".join(secrets.choice(UNAMBIGUOUS) for _ in range(4)) for _ in range(4)
        )
        settings.DATA_DIR.mkdir(parents=True, exist_ok=True)
        file.unlink(missing_ok=True)
        with os.fdopen(os.open(file, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600), "w") as out:
            out.write(password)
        with transaction.atomic():
            User.everywhere.create_user(
                FIRST_USERNAME, password=password, role=Role.LEAD, clinic=first_clinic()
            )
        return password
    if not file.exists():
        return None
    password = file.read_text()
    account = User.everywhere.filter(username=FIRST_USERNAME, is_active=True).first()
    if account is not None and account.check_password(password):
        return password
    file.unlink()
    return None
