"""Training sessions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, ClassVar

from django.db import models
from django.db.models import Case, Exists, F, OuterRef, Q, QuerySet, When
from django.utils import timezone
from django.utils.text import capfirst
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.feedback.translation import valence_choices
from rehab.people.consent.models import PatientScope
from rehab.people.consent.services import allows_remote_view
from rehab.people.field_policy import erased, personal_fields, retained
from rehab.people.models import SIDES, Clinic, Patient, User
from rehab.people.scope import ClinicModel
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.sessions.setup.walking_conditions import MAX_DEVICE_LETTERS, WalkingConditions
from rehab.stations.models import Device, Station
from rehab.training.changes import ENDED_STATES, OPEN_STATES, STATE_LABELS, State
from rehab.training.plans import SessionPlan
from rehab.training.valences import VALENCES

WALKED = retained("what was walked and how, under a pseudonym", shown=True, research=True)
ENDED_VISIBLE_FOR = timedelta(minutes=15)  # to the tablet of its station


@dataclass(frozen=True)
class SessionScope(PatientScope):
    """Rows of sessions: of its station's, a tablet sees those open and the one just ended.

    Everybody at the treadmill can use the tablet, also after a patient has left. Outside the
    clinic's networks it needs the consent to remote view that a person needs. ``session`` is the
    lookup of the session's key.
    """

    session: str = "session"

    def device_filter(self, device: Any) -> Q:
        """Return the condition for a device, besides that of its station.

        Sources and robots have no pages; the server answers them that an ended session has ended.
        """
        if device.kind != Device.Kind.TABLET:
            return Q()
        open_or_ended = Q(**_in_states(OPEN_STATES)) | Q(pk__in=_just_ended(device, timezone.now()))
        here = TrainingSession.everywhere.filter(open_or_ended, station=device.station_id)
        if device.is_away:
            here = here.filter(allows_remote_view("patient"))
        return Q(**{f"{self.session}__in": here.values("pk")})


def _in_states(states: Iterable[State]) -> dict[str, Any]:
    return {"state__in": [state.value for state in states]}


def _just_ended(tablet: Device, now: datetime) -> QuerySet[TrainingSession, Any]:
    """Return the key of the last session that ended at a tablet's station.

    It counts until the next one starts there, and for a quarter of an hour at most.
    """
    here = TrainingSession.everywhere.filter(station=tablet.station_id)
    last = here.filter(**_in_states(ENDED_STATES), ended_at__isnull=False).order_by("-ended_at")
    others = here.exclude(pk=OuterRef("pk"))
    started_since = others.filter(started_at__gte=OuterRef("ended_at"))
    recent = here.filter(pk__in=last.values("pk")[:1], ended_at__gt=now - ENDED_VISIBLE_FOR)
    return recent.exclude(Exists(started_since)).values("pk")


class TrainingSession(ClinicModel):
    """One session of one patient.

    ``plan`` is what every step is scored with; the columns beside it are for queries.
    ``state``, ``goal``, ``started_at``, ``ended_at``, ``changed_to`` and ``active_s`` follow from
    the log and are written together with its changes (``active_s`` of a running session is that of
    its last one). ``valence`` is the valence that it began with. Only a correction changes
    ``patient`` and ``excluded`` (``corrections.py``).
    """

    scope = SessionScope(clinic="clinic", station="station", session="pk")

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
        db_index=False,  # an index below begins with it
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
        MeasureDefinition,
        on_delete=models.PROTECT,
        related_name="sessions",
        verbose_name=_("measure"),
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
        choices=valence_choices,
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
    # How the patient walked (setup/walking_conditions.py); for analyses, and in no score.
    device = models.CharField(_("device"), max_length=MAX_DEVICE_LETTERS, blank=True)
    belt_speed_m_s = models.FloatField(_("belt speed (m/s)"), null=True, blank=True)
    weight_support_percent = models.FloatField(_("body-weight support (%)"), null=True, blank=True)

    state = models.CharField(
        _("state"),
        max_length=16,
        choices=[(state.value, capfirst(_(label))) for state, label in STATE_LABELS.items()],
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
    # The log's end as it was last noted: with changes and checkpoints, and when it is unloaded.
    last_number = models.PositiveIntegerField(default=0, editable=False)
    # Whether steps or events may lack a seal (``seals``).
    unsealed = models.BooleanField(default=True, editable=False)
    # Of an open session: the fold of its first steps, so that the rest is quickly folded.
    checkpoint = models.JSONField(null=True, editable=False)

    personal = personal_fields(
        {
            # Sources may be files that are named after a person.
            "source": erased("", shown=True, research=False),
            "source_args": erased([], shown=False, research=False),
            "legacy_row": erased(shown=False, research=False),
            # It is still marked as imported, but its original cannot be found.
            "legacy_id": erased(
                Case(When(legacy_id__isnull=False, then=-1 * F("pk"))), shown=False, research=False
            ),
            "patient created_at valence changed_to trained_side simulated plan protocol measure": (
                WALKED
            ),
            "device belt_speed_m_s weight_support_percent state goal started_at ended_at": WALKED,
            "active_s excluded": WALKED,
            "clinic station created_by": retained("places and staff", shown=False, research=False),
            "checkpoint": retained("None once it has ended", shown=False, research=False),
            "last_number unsealed": retained("the server's own", shown=False, research=False),
        }
    )

    class Meta(ClinicModel.Meta):
        verbose_name = _("session")
        verbose_name_plural = _("sessions")
        ordering: ClassVar = ["-created_at", "-pk"]
        indexes: ClassVar = [
            models.Index(fields=["clinic", "-created_at"], name="session_by_clinic_and_date"),
            models.Index(fields=["patient", "-created_at"], name="session_by_patient_and_date"),
            models.Index(fields=["station", "state"], name="session_by_station_and_state"),
            models.Index(
                fields=["clinic"],
                condition=Q(state=State.RUNNING.value),
                name="running_session_by_clinic",
            ),
            models.Index(
                fields=["clinic"], condition=Q(unsealed=True), name="unsealed_session_by_clinic"
            ),
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
    def walking(self) -> WalkingConditions:
        """How the patient walked, as far as it was noted."""
        return WalkingConditions(self.device, self.belt_speed_m_s, self.weight_support_percent)

    @property
    def began_at(self) -> datetime:
        """When it was started, or else set up."""
        return self.started_at or self.created_at

    @property
    def simulated_word(self) -> str:
        """How people read that it was no patient's own walk: a recording may be tried, too."""
        return gettext("Trial") if self.patient.simulated else gettext("Simulated")

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


def find_newest(few: QuerySet[TrainingSession, Any]) -> int | None:
    """Return the newest of a few sessions.

    Chosen here: to find it, a database may walk through all sessions of all clinics by their dates.
    """
    newest = max(few.order_by().values_list("created_at", "pk"), default=None)
    return None if newest is None else newest[1]
