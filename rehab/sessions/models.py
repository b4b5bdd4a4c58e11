"""What is trained, how a session is built, and the log of what happened in it."""

from __future__ import annotations

from enum import StrEnum
from typing import ClassVar

from django.core.exceptions import ValidationError
from django.db import models
from django.db.models import F, Q
from django.dispatch import Signal
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.consent import PatientScope
from rehab.people.models import SIDES, Clinic, Patient, User
from rehab.people.scope import ClinicRow, Scope, ScopedModel
from rehab.stations.models import Station
from rehab.training import measures as rules
from rehab.training.changes import ChangeKind, State
from rehab.training.metrics import METRICS
from rehab.training.phases import PHASE_KINDS, Phase
from rehab.training.plans import SessionPlan
from rehab.training.valences import VALENCES

STATES = {
    State.READY: _("Ready"),
    State.RUNNING: _("Running"),
    State.PAUSED: _("Paused"),
    State.FINISHED: _("Finished"),
    State.ABORTED: _("Aborted"),
}


def say_shared(row: Measure | Protocol) -> str:
    """Give the name of a row; one that all clinics share is said in the page's language."""
    return row.name if row.clinic_id else gettext(row.name)


class Measure(ClinicRow):
    """A quantity of a stride that can be trained. Without a clinic it is shared by all."""

    scope = Scope(clinic="clinic", shared=True, host=Q(clinic__isnull=True))

    clinic = models.ForeignKey(
        Clinic,
        on_delete=models.CASCADE,
        related_name="measures",
        null=True,
        blank=True,
        verbose_name=_("clinic"),
    )
    slug = models.SlugField(_("slug"), max_length=32)
    name = models.CharField(_("name"), max_length=64)
    unit = models.CharField(_("unit"), max_length=16)
    higher_is_better = models.BooleanField(_("higher is better"), default=True)
    value_min = models.FloatField(_("value min"), help_text=_("Smallest value that can be real."))
    value_max = models.FloatField(_("value max"), help_text=_("Largest value that can be real."))
    goal_min = models.FloatField(_("goal min"), help_text=_("A goal lies above this."))
    goal_max = models.FloatField(_("goal max"), help_text=_("A goal lies at or below this."))

    class Meta(ClinicRow.Meta):
        verbose_name = _("measure")
        verbose_name_plural = _("measures")
        ordering: ClassVar = ["name"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "slug"], name="measure_slug_once_per_clinic"),
            models.UniqueConstraint(
                fields=["slug"], condition=Q(clinic__isnull=True), name="measure_slug_once_shared"
            ),
            models.CheckConstraint(
                condition=Q(value_min__lt=F("value_max"))
                & Q(goal_min__gte=0)
                & Q(goal_min__lt=F("goal_max")),
                name="measure_bounds_in_order",
                violation_error_message=_(
                    "Each smallest value must lie below the largest; goals lie above 0."
                ),
            ),
        ]

    def __str__(self) -> str:
        return f"{say_shared(self)} [{self.unit}]"

    def to_rule(self) -> rules.Measure:
        """Give the measure as the rules know it."""
        return rules.Measure(
            slug=self.slug,
            name=self.name,
            unit=self.unit,
            value_min=self.value_min,
            value_max=self.value_max,
            goal_min=self.goal_min,
            goal_max=self.goal_max,
            higher_is_better=self.higher_is_better,
        )


class Protocol(ClinicRow):
    """A list of phases that sessions are built from. Without a clinic it is shared by all."""

    scope = Scope(clinic="clinic", shared=True, host=Q(clinic__isnull=True))

    clinic = models.ForeignKey(
        Clinic,
        on_delete=models.CASCADE,
        related_name="protocols",
        null=True,
        blank=True,
        verbose_name=_("clinic"),
    )
    name = models.CharField(_("name"), max_length=64)
    description = models.TextField(_("description"), blank=True)

    class Meta(ClinicRow.Meta):
        verbose_name = _("protocol")
        verbose_name_plural = _("protocols")
        ordering: ClassVar = ["name"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["clinic", "name"], name="protocol_name_once_per_clinic"
            ),
            models.UniqueConstraint(
                fields=["name"], condition=Q(clinic__isnull=True), name="protocol_name_once_shared"
            ),
        ]

    def __str__(self) -> str:
        return say_shared(self)

    def to_rules(self) -> tuple[Phase, ...]:
        """Give the phases as the rules know them."""
        phases = sorted(self.phases.all(), key=lambda phase: phase.position)  # also if prefetched
        return tuple(phase.to_rule() for phase in phases)


class ProtocolPhase(ScopedModel):
    """One phase of a protocol."""

    scope = Scope(clinic="protocol__clinic", shared=True, host=Q(protocol__clinic__isnull=True))

    protocol = models.ForeignKey(
        Protocol, on_delete=models.CASCADE, related_name="phases", verbose_name=_("protocol")
    )
    position = models.PositiveSmallIntegerField(_("position"))
    kind = models.CharField(
        _("kind"),
        max_length=16,
        choices=[(kind.slug, _(kind.label)) for kind in PHASE_KINDS.values()],
    )
    name = models.CharField(_("name"), max_length=64)
    feedback = models.BooleanField(
        _("feedback"), help_text=_("Whether the patient gets feedback in this phase.")
    )
    gain = models.FloatField(
        _("gain"),
        default=1.0,
        help_text=_("What is shown is this share of the measured value (0.5 to 1.5)."),
    )
    strides = models.PositiveIntegerField(
        _("strides"), null=True, blank=True, help_text=_("Ends after so many.")
    )
    seconds = models.FloatField(
        _("seconds"), null=True, blank=True, help_text=_("Ends after so many seconds.")
    )

    class Meta(ScopedModel.Meta):
        verbose_name = _("protocol phase")
        verbose_name_plural = _("protocol phases")
        ordering: ClassVar = ["protocol", "position"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["protocol", "position"], name="protocol_phase_position_once"
            )
        ]

    def __str__(self) -> str:
        return gettext(self.name)

    def to_rule(self) -> Phase:
        """Give the phase as the rules know it. Raises InvalidSetting for what they refuse."""
        return Phase(
            kind=self.kind,
            name=self.name,
            feedback=self.feedback,
            gain=self.gain,
            strides=self.strides,
            seconds=self.seconds,
        )

    def clean(self) -> None:
        """Refuse what the rules refuse, in the rules' own words."""
        try:
            self.to_rule()
        except rules.InvalidSetting as problem:
            raise ValidationError(str(problem)) from problem


class TrainingSession(ClinicRow):
    """One sitting of one patient, who is the same from its creation to its end.

    ``plan`` is what every step is scored with; the columns beside it are there to be found by.
    ``state``, ``goal``, ``started_at``, ``ended_at``, ``changed_to`` and ``active_s`` follow from
    the log and are written together with its changes (``active_s`` of a running session is that of
    its last one). ``valence`` is the feedback type it began with. Only a correction alters
    ``patient`` and ``left_out`` (``corrections.py``).
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
    runs = models.JSONField(
        default=list, editable=False, help_text=_("Arguments of the source that the server runs.")
    )
    plan = models.JSONField(_("plan"))

    state = models.CharField(
        _("state"),
        max_length=16,
        choices=[(state.value, words) for state, words in STATES.items()],
        default=State.READY.value,
    )
    goal = models.FloatField(
        _("goal"), null=True, blank=True, help_text=_("Goal in force (the measure's unit).")
    )
    started_at = models.DateTimeField(_("started at"), null=True, blank=True)
    ended_at = models.DateTimeField(_("ended at"), null=True, blank=True)
    active_s = models.FloatField(_("walked (s)"), default=0.0, help_text=_("Time without pauses."))
    left_out = models.BooleanField(
        _("left out"),
        default=False,
        editable=False,
        help_text=_("Corrected: in no figure, board or trend."),
    )
    # Its row in the original GARRY's database, where it was imported from there: without steps.
    original_id = models.BigIntegerField(_("imported session"), null=True, editable=False)
    original = models.JSONField(null=True, editable=False)
    # Which process writes the log: each taking over raises the epoch and shuts out the one before.
    epoch = models.PositiveIntegerField(default=0, editable=False)
    owner = models.CharField(max_length=200, blank=True, editable=False)

    class Meta(ClinicRow.Meta):
        verbose_name = _("session")
        verbose_name_plural = _("sessions")
        ordering: ClassVar = ["-created_at", "-pk"]
        indexes: ClassVar = [
            models.Index(fields=["clinic", "-created_at"], name="session_by_clinic_and_date"),
            models.Index(fields=["patient", "-created_at"], name="session_by_patient_and_date"),
        ]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["clinic", "original_id"], name="session_imported_once_per_clinic"
            )
        ]

    def __str__(self) -> str:
        return gettext("Session %(number)s") % {"number": self.pk}

    def to_plan(self) -> SessionPlan:
        """Give the plan as the rules know it."""
        return SessionPlan.from_json(self.plan)

    @property
    def later_types(self) -> list[str]:
        """The feedback types that it was changed to on its way."""
        return self.changed_to.split(",") if self.changed_to else []

    @property
    def types_words(self) -> str:
        """Its feedback type, and those it was changed to, in words."""
        names = [gettext(VALENCES[slug].label) for slug in (self.valence, *self.later_types)]
        if len(names) == 1:
            return names[0]
        return gettext("%(first)s, changed to %(others)s") % {
            "first": names[0],
            "others": ", ".join(names[1:]),
        }


class Step(ScopedModel):
    """A scored stride. Rows are only ever added."""

    scope = PatientScope(
        clinic="session__clinic", station="session__station", patient="session__patient"
    )

    session = models.ForeignKey(
        TrainingSession, on_delete=models.PROTECT, related_name="steps", verbose_name=_("session")
    )
    number = models.PositiveIntegerField(_("number"))
    time_s = models.FloatField(_("time (s)"), help_text=_("The source's clock."))
    received_at = models.DateTimeField(_("received at"), help_text=_("The server's clock."))
    side = models.CharField(_("side"), max_length=8, choices=SIDES)
    value = models.FloatField(_("value"), null=True)
    gain = models.FloatField(_("gain"))
    shown = models.FloatField(_("shown"), null=True)
    goal = models.FloatField(_("goal"), null=True)
    performance = models.FloatField(_("performance"), null=True)
    hit = models.BooleanField(_("hit"), null=True)
    points = models.SmallIntegerField(_("points"), null=True)
    valid = models.BooleanField(_("valid"))
    reasons = models.JSONField(_("reasons"), default=list)
    phase = models.PositiveSmallIntegerField(
        _("phase"), help_text=_("Index into the plan's phases.")
    )
    rules_version = models.PositiveSmallIntegerField(_("rules version"))
    extra = models.JSONField(_("extra"), default=dict)

    class Meta(ScopedModel.Meta):
        verbose_name = _("step")
        verbose_name_plural = _("steps")
        ordering: ClassVar = ["session", "number"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["session", "number"], name="step_number_once")
        ]

    def __str__(self) -> str:
        return gettext("Step %(number)d") % {"number": self.number}


class RobotEntry(StrEnum):
    """What the log keeps of a session's robot. It alters no score: folding passes it over."""

    STOP = "robot_stop"
    ARM = "robot_arm"
    DECISION = "robot_decision"
    GESTURE = "robot_gesture"


class Remark(StrEnum):
    """What a PT notes with one tap while somebody walks. It alters no score either."""

    REST = "rest"
    PAIN = "pain"
    DIZZINESS = "dizziness"
    NEAR_FALL = "near_fall"
    FALL = "fall"
    HANDRAIL = "handrail"
    VERBAL_CUE = "verbal_cue"
    BORG = "borg"  # felt exertion, Borg CR10: 0 to 10 in ``value``


EVENTS = {
    ChangeKind.START: _("start"),
    ChangeKind.PAUSE: _("pause"),
    ChangeKind.RESUME: _("resume"),
    ChangeKind.FINISH: _("finish"),
    ChangeKind.ABORT: _("abort"),
    ChangeKind.GOAL: _("goal"),
    ChangeKind.GAIN: _("gain"),
    ChangeKind.PHASE: _("phase"),
    ChangeKind.ACTIVATION_THRESHOLD: _("activation threshold"),
    ChangeKind.ROBOT_INTENSITY: _("robot intensity"),
    ChangeKind.VALENCE: _("feedback type"),
    ChangeKind.WORDS: _("words"),
    ChangeKind.WORDS_SHOWN: _("words shown"),
    ChangeKind.CHART_STYLE: _("chart style"),
    RobotEntry.STOP: _("robot stop"),
    RobotEntry.ARM: _("robot arm"),
    RobotEntry.DECISION: _("robot decision"),
    RobotEntry.GESTURE: _("robot gesture"),
    Remark.REST: _("rest"),
    Remark.PAIN: _("pain"),
    Remark.DIZZINESS: _("dizziness"),
    Remark.NEAR_FALL: _("near fall"),
    Remark.FALL: _("fall"),
    Remark.HANDRAIL: _("handrail"),
    Remark.VERBAL_CUE: _("verbal cue"),
    Remark.BORG: _("borg"),
}


class SessionEvent(ScopedModel):
    """What was done to a session, noted of it, or done by its robot, ordered against its steps.
    Rows are only added.

    ``data``: what the robot reported; which device stopped it where that was no person; as
    ``value`` (and ``old``) what a change was to that is no number: a name, or words and their type.
    """

    scope = PatientScope(
        clinic="session__clinic", station="session__station", patient="session__patient"
    )

    session = models.ForeignKey(
        TrainingSession, on_delete=models.PROTECT, related_name="events", verbose_name=_("session")
    )
    after_number = models.PositiveIntegerField(
        _("after number"), help_text=_("The last step before it; 0 for none.")
    )
    kind = models.CharField(
        _("kind"), max_length=32, choices=[(kind.value, words) for kind, words in EVENTS.items()]
    )
    old = models.FloatField(_("old"), null=True)
    value = models.FloatField(_("value"), null=True)
    by = models.ForeignKey(
        User, on_delete=models.SET_NULL, related_name="+", null=True, verbose_name=_("by")
    )
    at = models.DateTimeField(_("at"))
    data = models.JSONField(_("data"), default=dict)

    class Meta(ScopedModel.Meta):
        verbose_name = _("session event")
        verbose_name_plural = _("session events")
        ordering: ClassVar = ["session", "pk"]

    def __str__(self) -> str:
        return self.get_kind_display()


# Sent with ``sessions``, a set of keys, within the transaction that stores their figures.
figures_stored = Signal()


class SessionMetric(ScopedModel):
    """A figure of an ended session: what boards and reports rank and compare."""

    scope = PatientScope(
        clinic="session__clinic", station="session__station", patient="session__patient"
    )

    session = models.ForeignKey(
        TrainingSession, on_delete=models.CASCADE, related_name="metrics", verbose_name=_("session")
    )
    slug = models.CharField(
        _("slug"),
        max_length=32,
        choices=[(metric.slug, _(metric.label)) for metric in METRICS.values()],
    )
    value = models.FloatField(_("value"))

    class Meta(ScopedModel.Meta):
        verbose_name = _("session metric")
        verbose_name_plural = _("session metrics")
        ordering: ClassVar = ["session", "slug"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["session", "slug"], name="session_metric_once")
        ]
        indexes: ClassVar = [models.Index(fields=["slug", "value"], name="metric_by_value")]

    def __str__(self) -> str:
        return f"{self.get_slug_display()}: {self.value:g}"
