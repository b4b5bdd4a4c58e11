"""Commands as a person types them on this installation: of the package, or of a checkout."""

from __future__ import annotations

import re
from importlib.metadata import PackageNotFoundError, version

from django.conf import settings


def command(words: str) -> str:
    """Return the line that runs a command here: "garry doctor"; in a checkout by manage.py."""
    if words == "serve" and not settings.IS_INSTALLED:
        return "make run"
    return f"{settings.PROGRAM} {words}"


def garry_version() -> str:
    """Return the version of GARRY that is installed."""
    try:
        return version("garry")
    except PackageNotFoundError:
        return "unknown"


def reinstall() -> str:
    """Return the line that brings files back which are missing."""
    return "pip install --force-reinstall garry" if settings.IS_INSTALLED else "make setup"


def as_typed_here(text: str, address: str) -> str:
    """Return a page of the documentation with this installation's commands and its address."""
    # A container's "python manage.py" stays.
    pattern = r"\.venv/bin/python manage\.py|(?<!python )manage\.py"
    text = re.sub(pattern, lambda _: str(settings.PROGRAM), text)
    text = text.replace("make run", command("serve")).replace("http://127.0.0.1:8000", address)
    return text.replace("`var/", f"`{settings.DATA_DIR}/") if settings.IS_INSTALLED else text
