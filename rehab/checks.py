"""System checks: each misconfiguration has an id, a sentence and a cure."""

from __future__ import annotations

import os
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from django.conf import settings
from django.core import checks
from django.core.checks import CheckMessage, Error, Tags, register

from rehab.people.commands import command, reinstall
from rehab.people.field_policy import find_undeclared
from rehab.stations.https.certificate import is_encrypting

# Variables of tests, of robots and of sources, which may run on the same machine.
OF_OTHERS = ("GARRY_TEST_", "GARRY_ROBOT", "GARRY_ROS_URL", "GARRY_SERVER", "GARRY_TOKEN")


def _is_loopback(host: str) -> bool:
    """Return whether only the machine itself reaches an address that the server listens on."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


@register()
def check_hosting(**_: Any) -> list[CheckMessage]:
    """Check names, and that a hosted server has PostgreSQL."""
    found: list[CheckMessage] = []
    if not settings.HOSTED:
        if not _is_loopback(settings.HOST) and not is_encrypting():
            found.append(
                checks.Warning(
                    f"The server listens on {settings.HOST} without TLS: passwords and patients' "
                    "data can be read on the network between.",
                    hint=f"Serve by `{command('serve --https')}`, or use "
                    "GARRY_HOST in a network of the clinic's own that nobody else can enter.",
                    id="garry.W011",
                )
            )
        if "*" in settings.ALLOWED_HOSTS:
            found.append(
                checks.Warning(
                    "The server answers to every name, so a foreign page can reach it.",
                    hint="Set GARRY_ALLOWED_HOSTS to the names and addresses that tablets use.",
                    id="garry.W003",
                )
            )
        return found
    if settings.DATABASES["default"]["ENGINE"].endswith("sqlite3"):
        found.append(
            Error(
                "A hosted server keeps its data in PostgreSQL.",
                hint="Set GARRY_DATABASE_URL=postgres://user:password@host/name.",
                id="garry.E004",
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


@register(Tags.security)
def check_privacy_of_files(**_: Any) -> list[CheckMessage]:
    """Check that other accounts of the machine can open neither data folder nor database."""
    if os.name != "posix":
        return []
    private = [settings.DATA_DIR]
    database = settings.DATABASES["default"]
    if database["ENGINE"].endswith("sqlite3"):
        file = Path(database["NAME"])
        if not _is_private(file.parent):
            private.append(file)
    return [
        Error(
            f"Other accounts of this machine can open {path}, and with it sign in as anybody.",
            hint=f"As its owner: chmod go-rwx {path}, or move it (GARRY_DATA_DIR).",
            id="garry.E011",
        )
        for path in private
        if path.exists() and not _is_private(path)
    ]


def _is_private(path: Path) -> bool:
    return path.exists() and not path.stat().st_mode & 0o077


@register()
def check_browser_libraries(**_: Any) -> list[CheckMessage]:
    """Check that the browser libraries are installed."""
    missing = [name for name, folder in settings.BROWSER_LIBRARIES.items() if not folder.is_dir()]
    if not missing:
        return []
    return [
        checks.Warning(
            f"Browser libraries are missing: {', '.join(missing)}. Pages cannot draw charts.",
            hint=f"Run `{reinstall()}`.",
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
        and not name.startswith(OF_OTHERS)
        and name not in settings.VARIABLES
    ]


@register(Tags.models)
def check_personal_fields(**_: Any) -> list[CheckMessage]:
    """Check that each field about a patient says what becomes of it."""
    return [
        Error(
            f"{name} leads to a patient, and its model does not say what becomes of it.",
            hint="Add it to `personal`, beside the model's fields: whether it is erased, shown in "
            "the patient's data, exported for research and recorded in the history "
            "(rehab/people/field_policy.py). An entry of no field goes.",
            id="garry.E013",
        )
        for name in find_undeclared()
    ]
