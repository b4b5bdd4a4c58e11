"""The log of a session: its steps, its events, and its figures."""

from __future__ import annotations

from enum import StrEnum
from typing import ClassVar

from django.db import models
from django.db.models import OuterRef, Subquery
from django.db.models.functions import Coalesce, Greatest
from django.dispatch import Signal
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.append_only import Allowed, AppendOnlyModel
from rehab.people.field_policy import erased_by, personal_fields, retained
from rehab.people.models import SIDES, Patient, User
from rehab.people.scope import ScopedModel
from rehab.sessions.models import SessionScope, TrainingSession
from rehab.sessions.setup.walking_conditions import BELT_M_S, SUPPORT_PERCENT
from rehab.training.changes import ChangeKind, PauseReason
from rehab.training.controls import CONTROLS
from rehab.training.summary.metrics import METRICS

PATIENT_IS_ERASED = (
    "EXISTS (SELECT 1 FROM rehab_trainingsession s JOIN rehab_patient p ON p.id = s.patient_id "
    "WHERE s.id = OLD.session_id AND p.erased_at IS NOT NULL)"
)
MEASURED = retained("a measurement under a pseudonym", shown=True, research=True)


class Step(AppendOnlyModel):
    """A scored stride. Rows are only ever added."""

    scope = SessionScope(
        clinic="session__clinic", station="session__station", patient="session__patient"
    )

    session = models.ForeignKey(
        TrainingSession,
        on_delete=models.PROTECT,
        related_name="steps",
        db_index=False,  # the constraint's index begins with it
        verbose_name=_("session"),
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
    close = models.BooleanField(
        _("close"), db_default=False, help_text=_("Too uncertain to count as a hit or a miss.")
    )
    late = models.BooleanField(
        _("late"), db_default=False, help_text=_("It arrived too late to be shown live.")
    )
    points = models.SmallIntegerField(_("points"), null=True)
    valid = models.BooleanField(_("valid"))
    reasons = models.JSONField(_("reasons"), default=list)
    phase = models.PositiveSmallIntegerField(
        _("phase"), help_text=_("Index into the plan's phases.")
    )
    rules_version = models.PositiveSmallIntegerField(_("rules version"))
    extra = models.JSONField(_("extra"), default=dict)

    personal = personal_fields(
        {
            "session number time_s received_at side value gain shown goal performance hit close": (
                MEASURED
            ),
            "late points valid reasons phase rules_version extra": MEASURED,
        }
    )

    class Meta(AppendOnlyModel.Meta):
        verbose_name = _("step")
        verbose_name_plural = _("steps")
        ordering: ClassVar = ["session", "number"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["session", "number"], name="step_number_once")
        ]

    def __str__(self) -> str:
        return gettext("Step %(number)d") % {"number": self.number}


def noted_end() -> Greatest:
    """Return what a session's ``last_number`` becomes: its log's end, and never less than it was.

    So a log that has lost its end since then is found out (``replay.check_log``).
    """
    steps = Step.everywhere.filter(session=OuterRef("pk")).order_by("-number").values("number")
    return Greatest("last_number", Coalesce(Subquery(steps[:1]), 0))


class RobotEntry(StrEnum):
    """Events of a session's robot. They change no score: folding skips them."""

    STOP = "robot_stop"
    ARM = "robot_arm"
    DECISION = "robot_decision"
    GESTURE = "robot_gesture"


class RuleEntry(StrEnum):
    """What followed from the steps by the plan's own rules. Folding finds it again and skips it."""

    GOAL_FOLLOWED = "goal_followed"  # the staircase moved the goal
    PLANNED_REST = "planned_rest"  # the session paused for the rest after a phase
    HEART_RATE_LIMIT = "heart_rate_limit"  # the session paused above the plan's limit


# The entries of pauses by a plan's rules.
RULE_PAUSES = {
    PauseReason.REST: RuleEntry.PLANNED_REST,
    PauseReason.HEART_RATE: RuleEntry.HEART_RATE_LIMIT,
}


class PartEntry(StrEnum):
    """What else made the session. It changes no score."""

    PLUGIN = "plugin"  # a part of another package: kind, name, package and version in ``data``


class Remark(StrEnum):
    """What a PT notes with one tap during a session. It changes no score either.

    How badly the patient was hurt, and that it was not a fall after all, refer to the last fall. An
    acknowledgment ends the alarms of its kind (`alarms`); it alone is noted after the end, too.
    """

    REST = "rest"
    PAIN = "pain"  # 0 to 10 in ``value``
    DIZZINESS = "dizziness"
    NEAR_FALL = "near_fall"
    FALL = "fall"
    FALL_SEVERITY = "fall_severity"  # in ``value``, a `FallSeverity`
    FALL_WITHDRAWN = "fall_withdrawn"
    FALL_ACKNOWLEDGED = "fall_acknowledged"
    STOP_ACKNOWLEDGED = "stop_acknowledged"  # the robot's own
    VERBAL_CUE = "verbal_cue"
    BORG = "borg"  # felt exertion, Borg CR10: 0 to 10 in ``value``
    # How the patient walks from here on (`conditions`), in ``value``; also by a treadmill itself.
    BELT_SPEED = "belt_speed"  # [m/s]
    WEIGHT_SUPPORT = "weight_support"  # [%]
    WALKING_AID = "walking_aid"  # these four: 1 from here on, 0 no longer
    ORTHOSIS = "orthosis"
    HANDRAIL = "handrail"
    HELPING_HAND = "helping_hand"  # the therapist's


class FallSeverity(models.IntegerChoices):
    """How badly a patient was hurt by a fall: the levels of the National Database of Nursing
    Quality Indicators, short of death.
    """

    NONE = 0, _("not hurt")
    MINOR = 1, _("slightly hurt")
    MODERATE = 2, _("moderately hurt")
    MAJOR = 3, _("badly hurt")

    @property
    def meaning(self) -> str:
        """What it comes to, by the database's definitions."""
        return str(_MEANINGS[self])


_MEANINGS = {
    FallSeverity.NONE: _("nothing seen or felt"),
    FallSeverity.MINOR: _("pain, bruise or graze: ice, a dressing"),
    FallSeverity.MODERATE: _("stitches, a splint, a strain"),
    FallSeverity.MAJOR: _("broken bone, surgery, inner or head injury"),
}


# What helps a patient to walk: on or off.
ASSISTANCE = (Remark.WALKING_AID, Remark.ORTHOSIS, Remark.HANDRAIL, Remark.HELPING_HAND)
# Remarks with a value: the lowest and highest.
REMARK_RANGES: dict[Remark, tuple[float, float]] = {
    Remark.BORG: (0, 10),  # CR10
    Remark.PAIN: (0, 10),  # numeric rating scale
    Remark.BELT_SPEED: BELT_M_S,
    Remark.WEIGHT_SUPPORT: SUPPORT_PERCENT,
    **dict.fromkeys(ASSISTANCE, (0, 1)),
    Remark.FALL_SEVERITY: (FallSeverity.NONE.value, FallSeverity.MAJOR.value),
}


EVENTS = {
    **{kind: _(control.log_label) for kind, control in CONTROLS.items()},
    RuleEntry.GOAL_FOLLOWED: _("goal followed"),
    RuleEntry.PLANNED_REST: _("planned rest"),
    RuleEntry.HEART_RATE_LIMIT: _("heart rate above its limit"),
    PartEntry.PLUGIN: _("plug-in"),
    RobotEntry.STOP: _("robot stop"),
    RobotEntry.ARM: _("robot arm"),
    RobotEntry.DECISION: _("robot decision"),
    RobotEntry.GESTURE: _("robot gesture"),
    Remark.REST: _("rest"),
    Remark.PAIN: _("pain"),
    Remark.DIZZINESS: _("dizziness"),
    Remark.NEAR_FALL: _("near fall"),
    Remark.FALL: _("fall"),
    Remark.FALL_SEVERITY: _("hurt by the fall"),
    Remark.FALL_WITHDRAWN: _("it was not a fall"),
    Remark.FALL_ACKNOWLEDGED: _("fall seen by a therapist"),
    Remark.STOP_ACKNOWLEDGED: _("robot’s stop seen by a therapist"),
    Remark.VERBAL_CUE: _("verbal cue"),
    Remark.BORG: _("exertion"),
    Remark.BELT_SPEED: _("belt speed"),
    Remark.WEIGHT_SUPPORT: _("body-weight support"),
    Remark.WALKING_AID: _("walking aid"),
    Remark.ORTHOSIS: _("orthosis"),
    Remark.HANDRAIL: _("handrail"),
    Remark.HELPING_HAND: _("therapist’s hand"),
}


# What raises or ends an alarm (`alarms`): rows that pages look for again and again.
ALARM_KINDS = (
    Remark.FALL.value,
    Remark.FALL_WITHDRAWN.value,
    Remark.FALL_ACKNOWLEDGED.value,
    Remark.STOP_ACKNOWLEDGED.value,
    RobotEntry.STOP.value,
    RobotEntry.ARM.value,
)


def erase_typed_words(patient: Patient, _pseudonym: str) -> None:
    """Empty the words that were typed for a patient's sessions: they may name anybody."""
    events = SessionEvent.everywhere.filter(session__patient=patient)
    events.filter(kind__in=[remark.value for remark in Remark]).update(data={})
    edits = list(events.filter(kind=ChangeKind.FEEDBACK_TEXT.value))
    for edit in edits:
        for band in edit.data.get("value", {}).get("bands", ()):
            band["words"] = ""
    events.bulk_update(edits, ["data"])


class SessionEvent(AppendOnlyModel):
    """A change of a session, a remark, or an act of its robot, ordered against its steps.
    Rows are only added.

    ``data``: what the robot reported; which device stopped it where that was no person; as
    ``value`` (and ``old``) of a change that is no number: a name, or texts with their valence.
    """

    scope = SessionScope(
        clinic="session__clinic", station="session__station", patient="session__patient"
    )

    # An erasure empties typed words.
    allowed_changes = (Allowed(("data",), PATIENT_IS_ERASED),)

    session = models.ForeignKey(
        TrainingSession, on_delete=models.PROTECT, related_name="events", verbose_name=_("session")
    )
    after_number = models.PositiveIntegerField(
        _("after number"), help_text=_("The last step before it; 0 for none.")
    )
    kind = models.CharField(
        _("kind"), max_length=32, choices=[(str(kind), label) for kind, label in EVENTS.items()]
    )
    old = models.FloatField(_("old"), null=True)
    value = models.FloatField(_("value"), null=True)
    by = models.ForeignKey(
        User, on_delete=models.PROTECT, related_name="+", null=True, verbose_name=_("by")
    )
    at = models.DateTimeField(_("at"))
    data = models.JSONField(_("data"), default=dict)

    personal = personal_fields(
        {
            "data": erased_by(erase_typed_words, shown=True, research=True),
            "session after_number kind old value at": MEASURED,
            "by": retained("staff", shown=True, research=False),
        }
    )

    class Meta(AppendOnlyModel.Meta):
        verbose_name = _("session event")
        verbose_name_plural = _("session events")
        ordering: ClassVar = ["session", "pk"]
        indexes: ClassVar = [
            models.Index(
                fields=["at"], condition=models.Q(kind__in=ALARM_KINDS), name="event_of_alarm"
            )
        ]

    def __str__(self) -> str:
        return self.get_kind_display()


# Sent in the transaction in which figures of sessions are stored or corrected, with the keys of the
# patients; ``corrected`` where earlier figures were wrong.
figures_stored = Signal()


class SessionMetric(ScopedModel):
    """A figure of an ended session: what boards and reports rank and compare."""

    scope = SessionScope(
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

    personal = personal_fields({"session slug value": MEASURED})

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
