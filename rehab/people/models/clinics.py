"""Clinics, to which everything else belongs."""

from __future__ import annotations

import re
from typing import ClassVar
from zoneinfo import available_timezones

from django.conf import settings
from django.core.exceptions import ValidationError
from django.db import models
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

from rehab.people.networks import validate_networks
from rehab.people.ranges import between
from rehab.people.scope import Scope, ScopedModel

LANGUAGES = settings.LANGUAGES


def language_choices() -> list[tuple[str, str]]:
    """Return the languages; a function, so that another one takes no migration."""
    return list(LANGUAGES)


def validate_time_zone(name: str) -> None:
    """Refuse a name that is no time zone."""
    if name not in available_timezones():
        raise ValidationError(
            _("“%(name)s” is no time zone. Give a name such as Europe/Madrid."),
            params={"name": name},
        )


# What the text of a session may name (sessions/reports/text_note.py).
NOTE_PLACEHOLDERS = (
    *("day", "time", "name", "code", "own_goal", "walked", "strides", "hits", "score", "goal"),
    *("type", "conditions", "noted", "tests", "note"),
)
PLACEHOLDER = re.compile(r"{(\w+)}")


def validate_note_template(text: str) -> None:
    """Refuse a place for something that no session has."""
    unknown = [name for name in PLACEHOLDER.findall(text) if name not in NOTE_PLACEHOLDERS]
    if unknown:
        raise ValidationError(
            _("{%(name)s} is unknown. Known are: %(known)s."),
            params={"name": unknown[0], "known": " ".join(f"{{{n}}}" for n in NOTE_PLACEHOLDERS)},
        )


class Clinic(ScopedModel):
    """A place of care. Only its own people see what belongs to it."""

    scope = Scope(clinic="pk", host=Q())

    name = models.CharField(_("name"), max_length=100, unique=True)
    time_zone = models.CharField(
        _("time zone"), max_length=64, default="UTC", validators=[validate_time_zone]
    )
    language = models.CharField(_("language"), max_length=8, choices=language_choices, default="en")
    boards_across = models.BooleanField(
        _("boards across clinics"),
        default=False,
        help_text=_(
            "Patients who agree may stand, by their animal names, on boards with patients "
            "of other clinics."
        ),
    )
    second_factor_required = models.BooleanField(
        _("second factor required"),
        default=False,
        help_text=_(
            "Everybody who works here signs in with an app or a passkey besides the "
            "password. Whoever has none is led to set one up first; you as well."
        ),
    )
    research_needs_consent = models.BooleanField(
        _("research needs consent"),
        default=True,
        help_text=_(
            "Researchers see the sessions of those patients only who have agreed to research."
        ),
    )
    care_needs_consent = models.BooleanField(
        _("care needs consent"),
        default=False,
        help_text=_("No session can be set up for a patient who has not agreed to care."),
    )
    note_template = models.TextField(
        _("text of a session"),
        blank=True,
        max_length=2000,
        validators=[validate_note_template],
        help_text=_(
            "What a session’s page offers to copy into your own record, with places such as {day}, "
            "{walked}, {hits}, {conditions}, {noted}, {tests}, {note}. Empty: GARRY’s text."
        ),
    )
    networks = models.TextField(
        _("the clinic's own networks"),
        blank=True,
        max_length=1000,
        validators=[validate_networks],
        help_text=_(
            "One a line, such as 192.168.1.0/24. From elsewhere a session is watched only with "
            "the patient's consent to remote view; say so in your words. Empty: from anywhere, and "
            "nobody is asked."
        ),
    )
    retention_months = models.PositiveSmallIntegerField(
        _("keep patients (months)"),
        null=True,
        blank=True,
        validators=between(1, 1200, _("months")),
        help_text=_(
            "So long after the last session a patient's name, code and all that leads to the "
            "person are erased for good. Empty: never."
        ),
    )
    log_retention_months = models.PositiveSmallIntegerField(
        _("keep the logs (months)"),
        default=36,
        validators=between(12, 1200, _("months")),
        help_text=_("How long it is kept who looked at, changed and took out what."),
    )
    created_at = models.DateTimeField(_("created at"), auto_now_add=True)
    # Since then its rows may be deleted, also those that are only added otherwise.
    removing_at = models.DateTimeField(null=True, editable=False)

    class Meta(ScopedModel.Meta):
        verbose_name = _("clinic")
        verbose_name_plural = _("clinics")
        ordering: ClassVar = ["name"]

    def __str__(self) -> str:
        return self.name
