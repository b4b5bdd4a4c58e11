"""Refusals of a study's pages: shown with what to do, and logged without a name."""

from __future__ import annotations

import logging

from django.http import HttpRequest

from rehab.people.access import user_of
from rehab.people.web.refusals import format_refusal
from rehab.training.measures import InvalidSetting

log = logging.getLogger(__name__)


def refuse(request: HttpRequest, problem: InvalidSetting) -> str:
    """Return why something cannot be done, in the reader's language, and log the attempt."""
    log_refusal(request)
    return format_refusal(problem)


def log_refusal(request: HttpRequest) -> None:
    """Log who was refused what, without the reason's words, which may name a patient or an arm."""
    log.warning("Refused to account %s: %s", user_of(request).pk, request.path)
