"""System checks: each misconfiguration has an id, a sentence and a cure."""

from __future__ import annotations

import os
from typing import Any

from django.conf import settings
from django.core import checks
from django.core.checks import CheckMessage, Error, Tags, register


@register(Tags.security)
def check_secrets(**_: Any) -> list[CheckMessage]:
    """Check that a hosted server has its own secret key and no debug pages."""
    found: list[CheckMessage] = []
    if settings.HOSTED and not os.environ.get("GARRY_SECRET_KEY"):
        found.append(
            Error(
                "A hosted server needs a secret key of its own.",
                hint="Set GARRY_SECRET_KEY to 50 or more random characters.",
                id="garry.E001",
            )
        )
    if settings.HOSTED and settings.DEBUG:
        found.append(
            Error(
                "A hosted server must not show debug pages.",
                hint="Unset GARRY_DEBUG.",
                id="garry.E002",
            )
        )
    return found


@register()
def check_hosting(**_: Any) -> list[CheckMessage]:
    """Check host names, and that a hosted server has PostgreSQL and a channel layer."""
    found: list[CheckMessage] = []
    if not settings.HOSTED:
        if "*" in settings.ALLOWED_HOSTS:
            found.append(
                checks.Warning(
                    "The server answers to every name, so a foreign page can reach it.",
                    hint="Set GARRY_ALLOWED_HOSTS to the names and addresses that tablets use.",
                    id="garry.W003",
                )
            )
        return found
    if not settings.ALLOWED_HOSTS or "*" in settings.ALLOWED_HOSTS:
        found.append(
            Error(
                "A hosted server must know its own names.",
                hint="Set GARRY_ALLOWED_HOSTS, for example to garry.example.org.",
                id="garry.E003",
            )
        )
    if settings.DATABASES["default"]["ENGINE"].endswith("sqlite3"):
        found.append(
            Error(
                "A hosted server keeps its data in PostgreSQL.",
                hint="Set GARRY_DATABASE_URL=postgres://user:password@host/name.",
                id="garry.E004",
            )
        )
    if not settings.REDIS_URL:
        found.append(
            Error(
                "Server processes cannot reach each other without Redis.",
                hint="Set GARRY_REDIS_URL=redis://host:6379/0.",
                id="garry.E005",
            )
        )
    return found


@register()
def check_data_folder(**_: Any) -> list[CheckMessage]:
    """Check that the data folder is writable."""
    folder = settings.DATA_DIR
    if folder.is_dir() and os.access(folder, os.W_OK):
        return []
    if settings.HOSTED and not folder.exists():
        return []  # hosted servers keep nothing there but collected static files
    return [
        Error(
            f"The data folder {folder} cannot be written.",
            hint="Make it writable for the user that runs the server, or set GARRY_DATA_DIR.",
            id="garry.E006",
        )
    ]


@register()
def check_browser_libraries(**_: Any) -> list[CheckMessage]:
    """Check that the browser libraries are installed."""
    missing = [name for name, folder in settings.BROWSER_LIBRARIES.items() if not folder.is_dir()]
    if not missing:
        return []
    return [
        checks.Warning(
            f"Browser libraries are missing: {', '.join(missing)}. Pages cannot draw charts.",
            hint="Run `npm ci` in the project's folder, or `make setup`.",
            id="garry.W007",
        )
    ]


@register()
def check_variables(**_: Any) -> list[CheckMessage]:
    """Check that every GARRY_* variable that is set is known."""
    return [
        checks.Warning(
            f"{name} is set, but GARRY knows no such setting.",
            hint=f"Known settings: {', '.join(sorted(settings.VARIABLES))}.",
            id="garry.W008",
        )
        for name in sorted(os.environ)
        if name.startswith("GARRY_")
        and not name.startswith("GARRY_TEST_")
        and name not in settings.VARIABLES
    ]


@register()
def check_durability(**_: Any) -> list[CheckMessage]:
    """Check that SQLite writes each commit through to the disk."""
    database = settings.DATABASES["default"]
    if not database["ENGINE"].endswith("sqlite3"):
        return []
    command = database.get("OPTIONS", {}).get("init_command", "").replace(" ", "").lower()
    if "synchronous=full" in command and "journal_mode=wal" in command:
        return []
    return [
        Error(
            "SQLite may lose acknowledged steps in a power cut.",
            hint="Keep journal_mode=WAL and synchronous=FULL in the database's init_command.",
            id="garry.E009",
        )
    ]


@register()
def check_application_order(**_: Any) -> list[CheckMessage]:
    """Check that `rehab` comes before daphne, so that its commands take precedence."""
    apps = settings.INSTALLED_APPS
    if apps.index("rehab") < apps.index("daphne"):
        return []
    return [
        Error(
            "The application daphne is listed before rehab and replaces its commands.",
            hint="List rehab first in INSTALLED_APPS.",
            id="garry.E010",
        )
    ]
