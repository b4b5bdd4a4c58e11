"""The first start of a server: tables, a clinic, and an account to sign in with."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from django.conf import settings
from django.core.management import CommandError, call_command
from django.db import DatabaseError, connection, transaction
from django.db.migrations.executor import MigrationExecutor

from rehab.people.commands import command
from rehab.people.models import Clinic, User
from rehab.people.random_codes import random_words
from rehab.people.roles import Role

FIRST_USERNAME = "pt"
FIRST_CLINIC = "My clinic"


def count_pending_migrations() -> int:
    """Return how many migrations the database lacks."""
    executor = MigrationExecutor(connection)
    return len(executor.migration_plan(executor.loader.graph.leaf_nodes()))


def prepare_database(say: Callable[[str], object] = lambda _words: None) -> None:
    """Apply pending migrations; on a hosted server, refuse to start while some are pending.

    ``say`` is told what takes its time. Raises CommandError, with the cure, where the database
    cannot be reached or is not up to date.
    """
    try:
        pending = count_pending_migrations()
    except DatabaseError as problem:
        raise CommandError(
            f"The database cannot be reached: {problem}. Check GARRY_DATABASE_URL."
        ) from problem
    if not pending:
        return
    if settings.HOSTED:
        raise CommandError(
            f"The database lacks {pending} migration(s). Back it up, then run "
            f"`{command('migrate')}`."
        )
    say("Preparing the database, this once: some seconds …")
    call_command("migrate", verbosity=0, interactive=False)


def first_clinic() -> Clinic:
    """Return the clinic of a server that has only one; create it on first use."""
    return Clinic.everywhere.order_by("pk").first() or Clinic.everywhere.create(name=FIRST_CLINIC)


def first_password() -> str | None:
    """Return the first account's generated password; None once somebody has signed in with it.

    Creates clinic and account where there is no account yet. Until the first sign-in the password
    is stored in a file that only the server's user can read.
    """
    file = _password_file()
    if not User.everywhere.exists():
        password = random_words(3)
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


def forget_first_password(sender: Any, user: Any, **_: Any) -> None:
    """Remove the file of the first account's password. A receiver of `user_logged_in`."""
    if user.get_username() == FIRST_USERNAME:
        _password_file().unlink(missing_ok=True)


def _password_file() -> Path:
    file: Path = settings.DATA_DIR / "first_password"
    return file
