"""What is simulated counts for nobody; only in a demonstration, where all is, does it count."""

from __future__ import annotations

from django.conf import settings
from django.db.models import Q


def counted(path: str = "") -> Q:
    """Return the condition of the patients, or of the sessions, that lists and figures count.

    ``path``: the way from what is filtered to these, such as ``session__``.
    """
    return Q() if settings.DEMO else Q((f"{path}simulated", False))


def is_counted(simulated: bool) -> bool:
    """Return whether lists and figures count a patient or session, by whether it is simulated."""
    return not simulated or bool(settings.DEMO)
