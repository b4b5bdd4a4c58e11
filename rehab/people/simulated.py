"""What is simulated counts for nobody; only in a demonstration, where all is, does it count."""

from __future__ import annotations

from django.conf import settings
from django.db.models import Q


def counted() -> Q:
    """Return the condition of the patients, or of the sessions, that lists and figures count."""
    return Q() if settings.DEMO else Q(simulated=False)
