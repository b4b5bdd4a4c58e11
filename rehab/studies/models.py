"""Studies: what is compared, in which versions, and who must not know or may look early."""

from __future__ import annotations

from typing import Any, ClassVar

from django.core.validators import RegexValidator
from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.feedback.translation import valence_choices
from rehab.people.append_only import ACCOUNT_DELETED, Allowed, AppendOnlyModel
from rehab.people.audit.sealing import SealableModel
from rehab.people.models import Clinic, User
from rehab.people.ranges import between
from rehab.people.scope import ClinicModel, Scope, ScopedModel
from rehab.sessions.formatting import format_schedule
from rehab.sessions.setup.options import OPTIONS, build_parts
from rehab.sessions.setup.protocols import MeasureDefinition, Protocol
from rehab.studies.allocation.crossover import VisitPlan, crossover_groups
from rehab.studies.allocation.groups import Factor, Group
from rehab.studies.allocation.minimization import DEFAULT_PROBABILITY
from rehab.studies.allocation.scheme import Method, Scheme
from rehab.studies.analysis import outcomes
from rehab.studies.arms import EARLY_MONTHS, ArmRule, Condition, check_arms, check_channels
from rehab.training.measures import InvalidSetting
from rehab.training.phases import Phase
from rehab.training.plans import ROBOT_LEVELS

OUTCOMES = [(slug, _(label)) for slug, (label, _unit) in outcomes.OUTCOMES.items()]
SCHEDULE_FIELDS = ("schedule", "schedule_steps", "schedule_band")
METHODS = {
    Method.BLOCKS: _("Permuted blocks of random size"),
    Method.MINIMIZATION: _("Minimization"),
    Method.LIST: _("A list of our own"),
}


class StudyState(models.TextChoices):
    """How far a study is."""

    DRAFT = "draft", _("Draft")
    REGISTERED = "registered", _("Registered")
    RUNNING = "running", _("Running")
    CLOSED = "closed", _("Closed")


class Study(ClinicModel):
    """A comparison of arms. What it allocates by is sealed; ``commitment`` shows it did not change.

    Its arms and settings are fixed when it is registered; later changes make a new version.
    """

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.PROTECT, related_name="studies", verbose_name=_("clinic")
    )
    code = models.CharField(
        _("short name"),
        max_length=8,
        validators=[RegexValidator(r"^[A-Z][A-Z0-9]{1,7}\Z", _("2 to 8 capital letters, digits."))],
        help_text=_("Begins the participants' codes, such as VAL-001. Name no condition in it."),
    )
    title = models.CharField(
        _("title"),
        max_length=120,
        help_text=_("Assessors and patients read it: name no arm's condition as the better one."),
    )
    question = models.TextField(_("question and hypothesis"), max_length=4000)
    state = models.CharField(
        max_length=12, choices=StudyState.choices, default=StudyState.DRAFT, editable=False
    )
    crossover = models.BooleanField(
        _("crossover"), default=False, help_text=_("Everybody walks every arm, in balanced orders.")
    )
    method = models.CharField(
        _("allocation"),
        max_length=12,
        choices=[(method.value, label) for method, label in METHODS.items()],
        default=Method.BLOCKS.value,
    )
    factors = models.JSONField(default=list, editable=False)  # [[name, [level, …]], …]
    probability = models.FloatField(default=DEFAULT_PROBABILITY, editable=False)
    sealed = models.TextField(editable=False)
    commitment = models.CharField(max_length=64, editable=False)
    participants = models.PositiveIntegerField(
        _("participants planned"), validators=between(2, 10_000)
    )
    months_since_stroke = models.PositiveSmallIntegerField(
        _("least months since the stroke"),
        null=True,
        blank=True,
        help_text=_("Who may enroll. Empty: every patient, however recent the stroke."),
    )
    visits = models.PositiveSmallIntegerField(_("visits in each period"), default=1)
    days_between = models.PositiveSmallIntegerField(_("days between visits"), default=1)
    washout_days = models.PositiveSmallIntegerField(_("days between periods"), default=7)
    goal_percent = models.FloatField(
        _("goal (% of baseline)"), default=100, validators=between(50, 200, "%")
    )
    primary_outcome = models.CharField(_("primary outcome"), max_length=32, choices=OUTCOMES)
    secondary_outcomes = models.JSONField(_("secondary outcomes"), default=list, blank=True)
    created_by = models.ForeignKey(User, on_delete=models.SET_NULL, related_name="+", null=True)
    created_at = models.DateTimeField(default=timezone.now, editable=False)
    registered_at = models.DateTimeField(null=True, editable=False)
    started_at = models.DateTimeField(null=True, editable=False)
    # From then on nothing is hidden.
    closed_at = models.DateTimeField(null=True, editable=False)

    class Meta(ClinicModel.Meta):
        verbose_name = _("study")
        verbose_name_plural = _("studies")
        ordering: ClassVar = ["-created_at", "-pk"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "code"], name="study_code_once_per_clinic")
        ]

    def __str__(self) -> str:
        return f"{self.code}: {self.title}"

    @property
    def is_draft(self) -> bool:
        """Whether everything may still be changed."""
        return self.state == StudyState.DRAFT

    @property
    def visit_plan(self) -> VisitPlan:
        """When participants come. Raises InvalidSetting."""
        return VisitPlan(self.visits, self.days_between, self.washout_days)

    def arm_rules(self) -> list[ArmRule]:
        """Return the arms in the form that the rules use. Raises InvalidSetting."""
        return [arm.to_rule() for arm in self.arms.all()]

    def groups(self) -> tuple[Group, ...]:
        """Return what participants are allocated to. Raises InvalidSetting."""
        arms = self.arm_rules()
        check_arms(arms, crossover=self.crossover)
        check_channels([arm.measure.channel for arm in self.arms.select_related("measure")])
        if self.crossover:
            return crossover_groups([arm.code for arm in arms])
        return tuple(Group((arm.code,), arm.weight) for arm in arms)

    def scheme(self) -> Scheme:
        """Return how the study allocates. Raises InvalidSetting."""
        factors = tuple(Factor(name, tuple(levels)) for name, levels in self.factors)
        return Scheme(self.groups(), Method(self.method), factors, self.probability)

    @property
    def risks_early_punishment(self) -> bool:
        """Whether participants may get negative feedback early after their stroke.

        It then worked worse than reward (docs/reference/gait.md#feedback-and-time-since-stroke).
        """
        negative = any(arm.valence == "negative" for arm in self.arms.all())
        return negative and (self.months_since_stroke or 0) < EARLY_MONTHS


class StudyVersion(AppendOnlyModel):
    """A study as it was registered, and as it was changed later; each session names its version."""

    scope = Scope(clinic="study__clinic")
    allowed_changes = (ACCOUNT_DELETED,)

    study = models.ForeignKey(Study, on_delete=models.PROTECT, related_name="versions")
    number = models.PositiveSmallIntegerField()
    document = models.JSONField()
    digest = models.CharField(max_length=64)
    reason = models.TextField(_("why it is changed"), max_length=1000, blank=True)
    by = models.ForeignKey(User, on_delete=models.SET_NULL, related_name="+", null=True)
    at = models.DateTimeField(default=timezone.now)

    class Meta(AppendOnlyModel.Meta):
        verbose_name = _("version")
        ordering: ClassVar = ["number"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["study", "number"], name="study_version_once")
        ]

    def __str__(self) -> str:
        return f"{self.study.code} v{self.number}"


class Arm(ScopedModel):
    """One condition of a study: what a session of a participant is created with."""

    scope = Scope(clinic="study__clinic")

    study = models.ForeignKey(Study, on_delete=models.CASCADE, related_name="arms")
    position = models.PositiveSmallIntegerField()
    code = models.CharField(_("code"), max_length=4)
    name = models.CharField(_("name"), max_length=64)
    weight = models.PositiveSmallIntegerField(_("part of the ratio"), default=1)
    valence = models.CharField(_("feedback type"), max_length=16, choices=valence_choices)
    gain = models.FloatField(_("gain"), default=1.0)
    robot_intensity = models.FloatField(
        _("robot"),
        choices=[(value, _(level)) for level, value in ROBOT_LEVELS.items()],
        default=1.0,
    )
    schedule = models.CharField(
        _("feedback comes"),
        max_length=16,
        choices=OPTIONS["schedule"].choices_for(None),
        default=OPTIONS["schedule"].default,
    )
    schedule_steps = models.PositiveSmallIntegerField(
        _("steps between feedback"),
        default=OPTIONS["schedule_steps"].default,
        validators=OPTIONS["schedule_steps"].validators,
    )
    schedule_band = models.PositiveSmallIntegerField(
        _("band without feedback, ± % of the goal"),
        default=OPTIONS["schedule_band"].default,
        validators=OPTIONS["schedule_band"].validators,
    )
    measure = models.ForeignKey(
        MeasureDefinition, on_delete=models.PROTECT, related_name="+", verbose_name=_("measure")
    )
    # None once it was deleted; the study's versions still have what was walked.
    protocol = models.ForeignKey(
        Protocol, on_delete=models.SET_NULL, related_name="+", null=True, verbose_name=_("protocol")
    )

    class Meta(ScopedModel.Meta):
        verbose_name = _("arm")
        ordering: ClassVar = ["study", "position"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["study", "code"], name="arm_code_once_per_study")
        ]

    def __str__(self) -> str:
        return f"{self.code}: {self.name}"

    @property
    def feedback_schedule(self) -> str:
        """When feedback comes, in words."""
        return format_schedule(self.to_rule().condition.schedule)

    def phases(self) -> tuple[Phase, ...]:
        """Return the protocol's phases with the arm's gain. Raises InvalidSetting without one."""
        if self.protocol is None:
            message = gettext("The protocol of arm %(code)s was deleted. Choose another one.")
            raise InvalidSetting(message % {"code": self.code})
        return self.to_rule().condition.apply_to(self.protocol.to_rules())

    def to_rule(self) -> ArmRule:
        """Return the arm in the form that the rules use. Raises InvalidSetting."""
        answers = {name: getattr(self, name) for name in SCHEDULE_FIELDS}
        condition = Condition(
            self.valence,
            self.gain,
            self.robot_intensity,
            self.measure_id,
            self.protocol_id or 0,
            build_parts(answers)["schedule"].essential,
        )
        return ArmRule(self.code, self.name, self.weight, condition)


class StudyMark(SealableModel):
    """What an account is in a study besides its role, until ``ended_at``."""

    class Task(models.TextChoices):
        """What the mark allows or hides."""

        ASSESSOR = "assessor", _("Assesses, and must not know the arm")
        INTERIM = "interim", _("May look before the study is closed")

    scope = Scope(clinic="study__clinic")
    # With the event, which is sealed, of who ended it.
    allowed_changes = (
        Allowed(
            ("ended_at",),
            "OLD.ended_at IS NULL AND EXISTS (SELECT 1 FROM rehab_studyevent e WHERE "
            "e.study_id = NEW.study_id AND e.kind = 'unmarked' AND e.at = NEW.ended_at)",
        ),
    )
    sealed_fields = ("study", "user", "task", "by", "at")

    study = models.ForeignKey(Study, on_delete=models.PROTECT, related_name="marks")
    user = models.ForeignKey(User, on_delete=models.PROTECT, related_name="study_marks")
    task = models.CharField(_("task"), max_length=8, choices=Task.choices)
    by = models.ForeignKey(User, on_delete=models.PROTECT, related_name="+", null=True)
    at = models.DateTimeField(default=timezone.now)
    ended_at = models.DateTimeField(null=True)

    class Meta(SealableModel.Meta):
        verbose_name = _("mark")
        ordering: ClassVar = ["pk"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["study", "user", "task"],
                condition=Q(ended_at=None),
                name="study_mark_holds_once",
            )
        ]

    def __str__(self) -> str:
        return f"{self.user}: {self.get_task_display()}"


def has_mark(study: Study, user: Any, task: StudyMark.Task) -> bool:
    """Return whether the account ``user`` has the mark ``task`` in a study now."""
    return study.marks.filter(user=user, task=task, ended_at=None).exists()
