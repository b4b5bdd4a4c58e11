"""Training sessions."""

from __future__ import annotations

from datetime import datetime
from typing import ClassVar

from django.db import models
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.consent.models import PatientScope
from rehab.people.models import SIDES, Clinic, Patient, User
from rehab.people.scope import ClinicModel
from rehab.sessions.setup.protocols import Measure, Protocol
from rehab.stations.models import Station
from rehab.training.changes import State
from rehab.training.plans import SessionPlan
from rehab.training.valences import VALENCES

STATES = {
    State.READY: _("Ready"),
    State.RUNNING: _("Running"),
    State.PAUSED: _("Paused"),
    State.FINISHED: _("Finished"),
    State.ABORTED: _("Aborted"),
}


class TrainingSession(ClinicModel):
    """One session of one patient.

    ``plan`` is what every step is scored with; the columns beside it are for queries.
    ``state``, ``goal``, ``started_at``, ``ended_at``, ``changed_to`` and ``active_s`` follow from
    the log and are written together with its changes (``active_s`` of a running session is that of
    its last one). ``valence`` is the valence that it began with. Only a correction changes
    ``patient`` and ``excluded`` (``corrections.py``).
    """

    scope = PatientScope(clinic="clinic", station="station")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.PROTECT, related_name="sessions", verbose_name=_("clinic")
    )
    patient = models.ForeignKey(
        Patient, on_delete=models.PROTECT, related_name="sessions", verbose_name=_("patient")
    )
    station = models.ForeignKey(
        Station,
        on_delete=models.SET_NULL,
        related_name="sessions",
        null=True,
        blank=True,
        verbose_name=_("station"),
    )
    protocol = models.ForeignKey(
        Protocol,
        on_delete=models.SET_NULL,
        related_name="sessions",
        null=True,
        blank=True,
        verbose_name=_("protocol"),
    )
    measure = models.ForeignKey(
        Measure, on_delete=models.PROTECT, related_name="sessions", verbose_name=_("measure")
    )
    created_by = models.ForeignKey(
        User,
        on_delete=models.SET_NULL,
        related_name="+",
        null=True,
        blank=True,
        verbose_name=_("created by"),
    )
    created_at = models.DateTimeField(_("created at"), default=timezone.now, db_index=True)
    valence = models.CharField(
        _("feedback type"),
        max_length=16,
        choices=[(valence.slug, _(valence.label)) for valence in VALENCES.values()],
        db_index=True,
    )
    # Follows from the log, as the columns below `state` do.
    changed_to = models.CharField(
        max_length=64, blank=True, editable=False, help_text=_("Types after the first, in order.")
    )
    trained_side = models.CharField(_("trained side"), max_length=8, choices=SIDES)
    source = models.CharField(
        _("source"), max_length=200, blank=True, help_text=_("Where its steps come from.")
    )
    simulated = models.BooleanField(_("simulated"), default=False)
    source_args = models.JSONField(
        default=list,
        editable=False,
        help_text=_("Arguments of the source that the server runs."),
    )
    plan = models.JSONField(_("plan"))

    state = models.CharField(
        _("state"),
        max_length=16,
        choices=[(state.value, label) for state, label in STATES.items()],
        default=State.READY.value,
    )
    goal = models.FloatField(
        _("goal"), null=True, blank=True, help_text=_("Goal in force (the measure's unit).")
    )
    started_at = models.DateTimeField(_("started at"), null=True, blank=True)
    ended_at = models.DateTimeField(_("ended at"), null=True, blank=True)
    active_s = models.FloatField(_("walked (s)"), default=0.0, help_text=_("Time without pauses."))
    excluded = models.BooleanField(
        _("left out"),
        default=False,
        editable=False,
        help_text=_("Corrected: in no figure, board or trend."),
    )
    # Of an imported session, which has no steps: its key and row in the original GARRY's database.
    legacy_id = models.BigIntegerField(_("imported session"), null=True, editable=False)
    legacy_row = models.JSONField(null=True, editable=False)
    # The process that writes the log; a new owner raises the epoch, which locks the old one out.
    epoch = models.PositiveIntegerField(default=0, editable=False)
    owner = models.CharField(max_length=200, blank=True, editable=False)

    class Meta(ClinicModel.Meta):
        verbose_name = _("session")
        verbose_name_plural = _("sessions")
        ordering: ClassVar = ["-created_at", "-pk"]
        indexes: ClassVar = [
            models.Index(fields=["clinic", "-created_at"], name="session_by_clinic_and_date"),
            models.Index(fields=["patient", "-created_at"], name="session_by_patient_and_date"),
        ]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["clinic", "legacy_id"], name="session_imported_once_per_clinic"
            )
        ]

    def __str__(self) -> str:
        return gettext("Session %(number)s") % {"number": self.pk}

    def to_plan(self) -> SessionPlan:
        """Return the plan in the form that the rules use."""
        return SessionPlan.from_json(self.plan)

    @property
    def began_at(self) -> datetime:
        """When it was started, or else set up."""
        return self.started_at or self.created_at

    @property
    def later_valences(self) -> list[str]:
        """The valences that it was changed to while it ran, in order."""
        return self.changed_to.split(",") if self.changed_to else []

    @property
    def valences_label(self) -> str:
        """Its feedback type and those that it was changed to, as text."""
        names = [gettext(VALENCES[slug].label) for slug in (self.valence, *self.later_valences)]
        if len(names) == 1:
            return names[0]
        return gettext("%(first)s, changed to %(others)s") % {
            "first": names[0],
            "others": ", ".join(names[1:]),
        }
