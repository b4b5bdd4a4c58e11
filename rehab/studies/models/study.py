"""Studies: what is compared and how it is analyzed, in versions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from django.core.validators import RegexValidator
from django.db import models
from django.utils import timezone
from django.utils.functional import cached_property
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.append_only import ACCOUNT_DELETED, AppendOnlyModel
from rehab.people.models import Clinic, User
from rehab.people.ranges import between
from rehab.people.scope import ClinicModel, Scope
from rehab.sessions.available_tests import own_tests
from rehab.studies.allocation.crossover import VisitPlan, crossover_groups
from rehab.studies.allocation.groups_and_strata import Factor, Group
from rehab.studies.allocation.minimization import DEFAULT_PROBABILITY
from rehab.studies.allocation.scheme import Method, Scheme
from rehab.studies.analysis.outcomes import Outcome, outcomes_with
from rehab.studies.arms import EARLY_MONTHS, ArmRule, check_arms, check_channels

NOT = "not: "  # begins a criterion of exclusion among those that have to hold
SCHEDULE_FIELDS = ("schedule", "schedule_steps", "schedule_band")
SPENDINGS = {
    "obrien_fleming": _("Seldom early (O’Brien and Fleming)"),
    "pocock": _("Alike at each look (Pocock)"),
}
METHODS = {
    Method.BLOCKS: _("Permuted blocks of random size"),
    Method.MINIMIZATION: _("Minimization"),
    Method.LIST: _("A list of our own"),
}


def outcome_label(outcomes: Mapping[str, Outcome], slug: str) -> str:
    """Return what an outcome is called, translated; one that is not known by its slug."""
    one = outcomes.get(slug)
    if one is None:
        return slug
    label = gettext(one.label)
    return f"{label}, {gettext(one.window)}" if one.window else label


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
    inclusion = models.TextField(
        _("criteria of inclusion"),
        max_length=4000,
        blank=True,
        help_text=_("One a line. Each is asked when a patient is enrolled, and has to be met."),
    )
    exclusion = models.TextField(
        _("criteria of exclusion"),
        max_length=4000,
        blank=True,
        help_text=_("One a line. Who meets one of them is not enrolled."),
    )
    visits = models.PositiveSmallIntegerField(_("visits in each period"), default=1)
    days_between = models.PositiveSmallIntegerField(_("days between visits"), default=1)
    washout_days = models.PositiveSmallIntegerField(_("days between periods"), default=7)
    follow_up_days = models.PositiveSmallIntegerField(
        _("days to the follow-up"),
        null=True,
        blank=True,
        help_text=_("After the last visit: a baseline, without feedback. Empty: no follow-up."),
    )
    window_days = models.PositiveSmallIntegerField(
        _("days that a visit may be off"),
        null=True,
        blank=True,
        validators=between(0, 30),
        help_text=_(
            "Before or after the planned day. Further off is a deviation. Empty: any day will do."
        ),
    )
    goal_percent = models.FloatField(
        _("goal (% of baseline)"), default=100, validators=between(50, 200, "%")
    )
    primary_outcome = models.CharField(_("primary outcome"), max_length=32)
    secondary_outcomes = models.JSONField(_("secondary outcomes"), default=list, blank=True)
    margin = models.FloatField(
        _("margin of non-inferiority"),
        null=True,
        blank=True,
        validators=between(0.001, 1000),
        help_text=_(
            "By how much a later arm may be worse than an earlier one in the primary outcome, in "
            "its unit. Empty: the study asks which arm is better."
        ),
    )
    spending = models.CharField(
        _("looks before the end"),
        max_length=16,
        blank=True,
        choices=list(SPENDINGS.items()),
        help_text=_(
            "How alpha, the chance of a false finding (0.05), is spent. Without it no look may "
            "stop the study."
        ),
    )
    planned_sd = models.FloatField(
        _("SD between people"),
        null=True,
        blank=True,
        validators=between(0.001, 1000),
        help_text=_("Of the primary outcome, from earlier studies."),
    )
    assumed = models.JSONField(default=dict, editable=False)  # `analysis.sample_size.Assumed`
    facts = models.JSONField(default=dict, editable=False)  # to what `registration.facts` asks
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

    @cached_property
    def outcomes(self) -> dict[str, Outcome]:
        """All that may be registered, by slug: also the tests of the clinic's own."""
        return outcomes_with(own_tests(self.clinic_id).values())

    def outcome_label(self, slug: str) -> str:
        """Return what an outcome is called, translated."""
        return outcome_label(self.outcomes, slug)

    @property
    def inclusion_criteria(self) -> list[str]:
        """What each participant has to meet."""
        return list(filter(None, map(str.strip, self.inclusion.splitlines())))

    @property
    def exclusion_criteria(self) -> list[str]:
        """What no participant may meet."""
        return list(filter(None, map(str.strip, self.exclusion.splitlines())))

    @property
    def criteria(self) -> list[str]:
        """All that has to hold of a participant, in words: those of exclusion with “not” before."""
        return [*self.inclusion_criteria, *(f"{NOT}{one}" for one in self.exclusion_criteria)]

    @property
    def visit_plan(self) -> VisitPlan:
        """When participants come. Raises InvalidSetting."""
        return VisitPlan(self.visits, self.days_between, self.washout_days, self.follow_up_days)

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
    # Whether who takes part has to agree to it before the next visit.
    needs_consent = models.BooleanField(_("participants have to agree again"), default=False)
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
