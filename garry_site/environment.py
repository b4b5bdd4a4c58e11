"""Typed readers of GARRY_* variables: a wrong value stops the start with an error that names valid
ones.
"""

import os
import re
import shutil
import sys
from pathlib import Path

from django.core.exceptions import ImproperlyConfigured

VARIABLES: dict[str, str] = {}  # every variable that is read, and what it is for


def text(name: str, default: str, about: str) -> str:
    """Read a variable as text.

    Refused with a comment in it: a shell takes one off, systemd and containers do not, so that a
    command and the server would have two keys.
    """
    VARIABLES[name] = about
    value = os.environ.get(name, "")
    if re.search(r"\s#", value):
        raise ImproperlyConfigured(
            f"{name} has a comment in its value. Put comments (#) on lines of their own."
        )
    return value or default


def flag(name: str, default: bool, about: str) -> bool:
    """Read a variable as yes or no."""
    value = text(name, "yes" if default else "no", about).lower()
    if value not in {"1", "true", "yes", "on", "0", "false", "no", "off"}:
        raise ImproperlyConfigured(f"{name}={value!r} is neither yes nor no. Set it to 1 or 0.")
    return value in {"1", "true", "yes", "on"}


def number(name: str, default: int, about: str, *, low: int, high: int) -> int:
    """Read a variable as a whole number within bounds."""
    value = text(name, str(default), about)
    if not (value.isascii() and value.isdigit() and low <= int(value) <= high):
        raise ImproperlyConfigured(f"{name}={value!r} must be a whole number from {low} to {high}.")
    return int(value)


def string_list(name: str, default: str, about: str) -> list[str]:
    """Read a variable as a comma-separated list."""
    return [word.strip() for word in text(name, default, about).split(",") if word.strip()]


def name_program(is_installed: bool) -> str:
    """Return how a person here types the program that all commands begin with."""
    if not is_installed:
        return ".venv/bin/python manage.py"
    if Path(sys.prefix).parent.name.startswith("archive-v"):  # uvx runs it, and installs nothing
        return "uvx --from 'garry[server]' garry"
    return "garry" if shutil.which("garry") else str(Path(sys.prefix, "bin", "garry"))
