"""What a problem is reported with: versions and states of an installation, and nobody's name."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable
from datetime import datetime
from importlib.metadata import distributions

from django.apps import apps
from django.conf import settings
from django.db import DatabaseError, connection
from django.db.models import Model

from robot.plugins import Plugin

RELEVANT = {"garry", "django", "channels", "daphne", "numpy", "scipy", "psycopg", "pyserial"}


def write_report(
    states: Iterable[tuple[str, str, bool]], plugins: Iterable[Plugin], now: datetime
) -> str:
    """Return what helps to find a problem: versions, sizes, diagnoses. Nothing that people typed.

    Of settings the names alone: values may be keys or addresses. ``states``: what `doctor` found,
    its state, and whether it needs care.
    """
    found = sorted(
        (one.name, one.version) for one in distributions() if one.name.lower() in RELEVANT
    )
    others = sorted({(one.package, one.version) for one in plugins})
    sizes = [
        (model._meta.label_lower, _count(model))
        for model in apps.get_app_config("rehab").get_models()
    ]
    texts = [
        f"GARRY, {now:%Y-%m-%d %H:%M} UTC",
        f"Python {platform.python_version()}, {platform.system()} {platform.release()}",
        f"database: {connection.vendor}; hosted: {settings.HOSTED}",
        f"set: {', '.join(sorted(name for name in settings.VARIABLES if name in os.environ))}",
        *(f"{name} {version}" for name, version in (*found, *others)),
        *(f"{label}: {count} rows" for label, count in sizes),
        *(f"{what}: {'needs care' if bad else 'well'}: {state}" for what, state, bad in states),
    ]
    home = str(settings.DATA_DIR)
    lines = (text.replace(home, "DATA").partition("\n")[0] for text in texts)
    return "".join(f"{line}\n" for line in lines)


def _count(model: type[Model]) -> int | str:
    """Return how many rows a model has; what stands in the way is among the diagnoses."""
    try:
        return model._base_manager.count()
    except DatabaseError:
        return "unknown"
