"""What a session's robot recorded: around its stops, and how it moved, as far as it was sent."""

from __future__ import annotations

from datetime import datetime
from typing import Any, ClassVar

from django.db import models
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.consent.models import PatientScope
from rehab.people.field_policy import personal_fields, retained
from rehab.people.scope import ScopedModel
from rehab.sessions.models import TrainingSession
from robot.wire.incident import MOTION, unpack

MAX_INCIDENTS = 40  # of a session, each of at most 60 kB
MAX_PARTS = 240  # of its motion: minutes


class RobotIncident(ScopedModel):
    """One incident, or with the reason ``MOTION`` a part of how it moved. Rows are only ever added.

    ``recording`` is packed as it came (``robot.wire.incident``).
    """

    scope = PatientScope(clinic="session__clinic", patient="session__patient")

    session = models.ForeignKey(
        TrainingSession,
        on_delete=models.PROTECT,
        related_name="incidents",
        verbose_name=_("session"),
    )
    at = models.DateTimeField(_("at"))
    reason = models.CharField(_("why the robot stopped"), max_length=64)
    recording = models.TextField(_("recording"))

    personal = personal_fields(
        {
            "session at reason recording": retained(
                "what the robot did, for its safety; no words", shown=True, research=True
            )
        }
    )

    class Meta(ScopedModel.Meta):
        verbose_name = _("incident of a robot")
        verbose_name_plural = _("incidents of robots")
        ordering: ClassVar = ["session", "pk"]

    def __str__(self) -> str:
        return gettext("Incident %(number)s") % {"number": self.pk}

    def records(self) -> list[dict[str, Any]]:
        """Return what was recorded. Raises BadFrame where it is damaged."""
        return unpack(self.recording)


def store_incident(session_id: int, at: datetime, reason: str, recording: str) -> int | None:
    """Store a recording and return its key; None where its session has too many already."""
    rows = RobotIncident.everywhere.filter(session=session_id)
    alike, most = rows.filter(reason=MOTION), MAX_PARTS
    if reason != MOTION:
        alike, most = rows.exclude(reason=MOTION), MAX_INCIDENTS
    if alike.count() >= most:
        return None
    incident = RobotIncident.everywhere.create(
        session_id=session_id, at=at, reason=reason, recording=recording
    )
    return incident.pk
