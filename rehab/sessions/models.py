"""What is trained, how a session is built, and the log of what happened in it."""

from __future__ import annotations

from enum import StrEnum
from typing import ClassVar

from django.core.exceptions import ValidationError
from django.db import models
from django.db.models import F, Q
from django.dispatch import Signal
from django.utils import timezone

from rehab.people.models import SIDES, Clinic, Patient, User
from rehab.people.scope import ClinicRow, Scope, ScopedModel
from rehab.stations.models import Station
from rehab.training import measures as rules
from rehab.training.changes import ChangeKind, State
from rehab.training.metrics import METRICS
from rehab.training.phases import PHASE_KINDS, Phase
from rehab.training.plans import SessionPlan
from rehab.training.valences import VALENCES


class Measure(ClinicRow):
    """A quantity of a stride that can be trained. Without a clinic it is shared by all."""

    scope = Scope(clinic="clinic", shared=True, host=Q(clinic__isnull=True))

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="measures", null=True, blank=True
    )
    slug = models.SlugField(max_length=32)
    name = models.CharField(max_length=64)
    unit = models.CharField(max_length=16)
    higher_is_better = models.BooleanField(default=True)
    value_min = models.FloatField(help_text="Smallest value that can be real.")
    value_max = models.FloatField(help_text="Largest value that can be real.")
    goal_min = models.FloatField(help_text="A goal lies above this.")
    goal_max = models.FloatField(help_text="A goal lies at or below this.")

    class Meta(ClinicRow.Meta):
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
                violation_error_message="Each smallest value must lie below the largest; "
                "goals lie above 0.",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.name} [{self.unit}]"

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
        Clinic, on_delete=models.CASCADE, related_name="protocols", null=True, blank=True
    )
    name = models.CharField(max_length=64)
    description = models.TextField(blank=True)

    class Meta(ClinicRow.Meta):
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
        return self.name

    def to_rules(self) -> tuple[Phase, ...]:
        """Give the phases as the rules know them."""
        phases = sorted(self.phases.all(), key=lambda phase: phase.position)  # also if prefetched
        return tuple(phase.to_rule() for phase in phases)


class ProtocolPhase(ScopedModel):
    """One phase of a protocol."""

    scope = Scope(clinic="protocol__clinic", shared=True, host=Q(protocol__clinic__isnull=True))

    protocol = models.ForeignKey(Protocol, on_delete=models.CASCADE, related_name="phases")
    position = models.PositiveSmallIntegerField()
    kind = models.CharField(
        max_length=16, choices=[(kind.slug, kind.label) for kind in PHASE_KINDS.values()]
    )
    name = models.CharField(max_length=64)
    feedback = models.BooleanField(help_text="Whether the patient gets feedback in this phase.")
    gain = models.FloatField(
        default=1.0, help_text="What is shown is this share of the measured value (0.5 to 1.5)."
    )
    strides = models.PositiveIntegerField(null=True, blank=True, help_text="Ends after so many.")
    seconds = models.FloatField(null=True, blank=True, help_text="Ends after so many seconds.")

    class Meta(ScopedModel.Meta):
        ordering: ClassVar = ["protocol", "position"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["protocol", "position"], name="protocol_phase_position_once"
            )
        ]

    def __str__(self) -> str:
        return self.name

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
    ``state``, ``goal``, ``started_at``, ``ended_at`` and ``active_s`` follow from the log and are
    written together with its changes (``active_s`` of a running session is that of its last one).
    Only a correction alters ``patient`` and ``left_out`` (``corrections.py``).
    """

    scope = Scope(clinic="clinic", station="station")

    clinic = models.ForeignKey(Clinic, on_delete=models.PROTECT, related_name="sessions")
    patient = models.ForeignKey(Patient, on_delete=models.PROTECT, related_name="sessions")
    station = models.ForeignKey(
        Station, on_delete=models.SET_NULL, related_name="sessions", null=True, blank=True
    )
    protocol = models.ForeignKey(
        Protocol, on_delete=models.SET_NULL, related_name="sessions", null=True, blank=True
    )
    measure = models.ForeignKey(Measure, on_delete=models.PROTECT, related_name="sessions")
    created_by = models.ForeignKey(
        User, on_delete=models.SET_NULL, related_name="+", null=True, blank=True
    )
    created_at = models.DateTimeField(default=timezone.now, db_index=True)
    valence = models.CharField(
        "feedback type",
        max_length=16,
        choices=[(valence.slug, valence.label) for valence in VALENCES.values()],
        db_index=True,
    )
    trained_side = models.CharField(max_length=8, choices=SIDES)
    source = models.CharField(max_length=200, blank=True, help_text="Where its steps come from.")
    simulated = models.BooleanField(default=False)
    runs = models.JSONField(
        default=list, editable=False, help_text="Arguments of the source that the server runs."
    )
    plan = models.JSONField()

    state = models.CharField(
        max_length=16,
        choices=[(state.value, state.value.capitalize()) for state in State],
        default=State.READY.value,
    )
    goal = models.FloatField(null=True, blank=True, help_text="Goal in force (the measure's unit).")
    started_at = models.DateTimeField(null=True, blank=True)
    ended_at = models.DateTimeField(null=True, blank=True)
    active_s = models.FloatField("walked (s)", default=0.0, help_text="Time without pauses.")
    left_out = models.BooleanField(
        default=False, editable=False, help_text="Corrected: in no figure, board or trend."
    )
    # Its row in the original GARRY's database, where it was imported from there: without steps.
    original_id = models.BigIntegerField("imported session", null=True, editable=False)
    original = models.JSONField(null=True, editable=False)
    # Which process writes the log: each taking over raises the epoch and shuts out the one before.
    epoch = models.PositiveIntegerField(default=0, editable=False)
    owner = models.CharField(max_length=200, blank=True, editable=False)

    class Meta(ClinicRow.Meta):
        verbose_name = "session"
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
        return f"Session {self.pk}"

    def to_plan(self) -> SessionPlan:
        """Give the plan as the rules know it."""
        return SessionPlan.from_json(self.plan)


class Step(ScopedModel):
    """A scored stride. Rows are only ever added."""

    scope = Scope(clinic="session__clinic", station="session__station")

    session = models.ForeignKey(TrainingSession, on_delete=models.PROTECT, related_name="steps")
    number = models.PositiveIntegerField()
    time_s = models.FloatField(help_text="The source's clock.")
    received_at = models.DateTimeField(help_text="The server's clock.")
    side = models.CharField(max_length=8, choices=SIDES)
    value = models.FloatField(null=True)
    gain = models.FloatField()
    shown = models.FloatField(null=True)
    goal = models.FloatField(null=True)
    performance = models.FloatField(null=True)
    hit = models.BooleanField(null=True)
    points = models.SmallIntegerField(null=True)
    valid = models.BooleanField()
    reasons = models.JSONField(default=list)
    phase = models.PositiveSmallIntegerField(help_text="Index into the plan's phases.")
    rules_version = models.PositiveSmallIntegerField()
    extra = models.JSONField(default=dict)

    class Meta(ScopedModel.Meta):
        ordering: ClassVar = ["session", "number"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["session", "number"], name="step_number_once")
        ]

    def __str__(self) -> str:
        return f"Step {self.number}"


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


EVENT_KINDS = [
    (kind.value, kind.value.replace("_", " "))
    for kinds in (ChangeKind, RobotEntry, Remark)
    for kind in kinds
]


class SessionEvent(ScopedModel):
    """What was done to a session, noted of it, or done by its robot, ordered against its steps.
    Rows are only added.

    ``data``: what the robot reported; which device stopped it where that was no person.
    """

    scope = Scope(clinic="session__clinic", station="session__station")

    session = models.ForeignKey(TrainingSession, on_delete=models.PROTECT, related_name="events")
    after_number = models.PositiveIntegerField(help_text="The last step before it; 0 for none.")
    kind = models.CharField(max_length=32, choices=EVENT_KINDS)
    old = models.FloatField(null=True)
    value = models.FloatField(null=True)
    by = models.ForeignKey(User, on_delete=models.SET_NULL, related_name="+", null=True)
    at = models.DateTimeField()
    data = models.JSONField(default=dict)

    class Meta(ScopedModel.Meta):
        ordering: ClassVar = ["session", "pk"]

    def __str__(self) -> str:
        return self.get_kind_display()


# Sent with ``sessions``, a set of keys, within the transaction that stores their figures.
figures_stored = Signal()


class SessionMetric(ScopedModel):
    """A figure of an ended session: what boards and reports rank and compare."""

    scope = Scope(clinic="session__clinic", station="session__station")

    session = models.ForeignKey(TrainingSession, on_delete=models.CASCADE, related_name="metrics")
    slug = models.CharField(
        max_length=32, choices=[(metric.slug, metric.label) for metric in METRICS.values()]
    )
    value = models.FloatField()

    class Meta(ScopedModel.Meta):
        ordering: ClassVar = ["session", "slug"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["session", "slug"], name="session_metric_once")
        ]
        indexes: ClassVar = [models.Index(fields=["slug", "value"], name="metric_by_value")]

    def __str__(self) -> str:
        return f"{self.get_slug_display()}: {self.value:g}"
