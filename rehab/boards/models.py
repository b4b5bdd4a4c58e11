"""Leaderboards as PTs build them, and the rows that groups of patients have on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from django.core.exceptions import ValidationError
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db import models
from django.db.models import Exists, Q
from django.utils.translation import gettext_lazy as _

from rehab.boards.rules import find_faults
from rehab.people.models import Boards, Clinic, Patient
from rehab.people.scope import ClinicModel, Scope, ScopedModel
from rehab.training.metrics import METRICS
from rehab.training.valences import VALENCES

# How rows are shown, and when. All else of a board decides what its rows are.
SHOWN_BY = frozenset(
    {
        "name",
        "display",  # but whose agreement it takes: `agreed`
        "top_n",
        "total_goal",
        "show_ranks",
        "ties",
        "names",
        "min_participants",
        "moment",
        "built_to",
    }
)

METRIC_LABELS = {
    "hit_rate": _("Steps at the goal (%)"),
    "mean_performance": _("Mean step, in % of the own goal"),
    "improvement_over_baseline": _("Improvement over the own baseline (%)"),
    "retention_in_washout": _("Improvement kept in the washout (%)"),
    "active_minutes": _("Minutes walked"),
    "target_met": _("Days on which the target was met"),
}


def metric_choices() -> list[tuple[str, Any]]:
    """Give what can be ranked by, the hit rate first."""
    slugs = sorted(METRICS, key=lambda slug: slug != "hit_rate")
    return [(slug, METRIC_LABELS.get(slug, _(METRICS[slug].label))) for slug in slugs]


@dataclass(frozen=True)
class BoardScope(Scope):
    """Boards of the own clinic, and those across clinics while it takes part in them."""

    def clinic_filter(self, clinic_id: int) -> Q:
        """Give the boards that a member of this clinic may see."""
        takes_part = Exists(Clinic.everywhere.filter(pk=clinic_id, boards_across=True))
        return Q(clinic=clinic_id) | Q(takes_part, clinic__isnull=True)


class Leaderboard(ClinicModel):
    """Who is compared with whom, by what, over which time, and how it is shown.

    Without a clinic it is the host's, and compares patients of all clinics that take part.
    """

    class Among(models.TextChoices):
        """Whose sessions are on the board."""

        SELF = "self", _("The patient's own sessions")
        GROUP = "group", _("A group of patients")
        CLINIC = "clinic", _("All patients of the clinic")
        ACROSS = "across", _("Patients of several clinics")

    class Types(models.TextChoices):
        """Which feedback types are on the board."""

        SAME = "same", _("Same as the session at hand")
        CHOSEN = "chosen", _("Chosen types")
        ALL = "all", _("All types")

    class Entry(models.TextChoices):
        """What stands in a row."""

        EACH = "each", _("Each session")
        BEST = "best", _("Best session")
        LATEST = "latest", _("Latest session")
        MEAN = "mean", _("Mean of the last sessions")
        SUM = "sum", _("Sum over the period")

    class Period(models.TextChoices):
        """Which sessions count."""

        ALL = "all", _("All time")
        DAYS_30 = "days_30", _("Last 30 days")
        WEEK = "week", _("This week")
        MONTH = "month", _("This month")
        DATES = "dates", _("Between two dates")

    class Ties(models.TextChoices):
        """How equal figures are ranked."""

        STANDARD = "standard", "1, 2, 2, 4"
        DENSE = "dense", "1, 2, 2, 3"
        EARLIER = "earlier", _("1, 2, 3, 4: the earlier first")

    class Display(models.TextChoices):
        """Which rows are shown."""

        NEIGHBORS = "neighbors", _("You and two on each side")
        TOP = "top", _("The best")
        TOP_AND_ME = "top_and_me", _("The best, and you")
        TOTAL = "total", _("One total, reached together")

    class Names(models.TextChoices):
        """What patients are called."""

        PSEUDONYM = "pseudonym", _("Animal names")
        INITIALS = "initials", _("Initials")
        CODE = "code", _("Codes")

    class Moment(models.TextChoices):
        """When it is shown."""

        AFTER_SESSION = "after_session", _("After a session")
        WAITING = "waiting", _("While the tablet waits")
        PT_ONLY = "pt_only", _("Only here, to therapists")

    scope = BoardScope(clinic="clinic", shared=True, host=Q(clinic__isnull=True))

    clinic = models.ForeignKey(
        Clinic,
        on_delete=models.CASCADE,
        related_name="leaderboards",
        null=True,
        blank=True,
        verbose_name=_("clinic"),
    )
    name = models.CharField(_("name on the tablet"), max_length=32)
    active = models.BooleanField(_("active"), default=True)
    among = models.CharField(
        _("compare with"), max_length=16, choices=Among.choices, default=Among.SELF
    )
    group = models.ManyToManyField(
        Patient, related_name="+", blank=True, verbose_name=_("patients of the group")
    )
    metric = models.CharField(
        _("measure"), max_length=32, choices=metric_choices(), default="hit_rate"
    )
    higher_is_better = models.BooleanField(_("higher is better"), default=True)
    entry = models.CharField(
        _("a row is"), max_length=16, choices=Entry.choices, default=Entry.EACH
    )
    mean_of = models.PositiveSmallIntegerField(
        _("sessions in the mean"), default=3, validators=[MinValueValidator(1)]
    )
    types = models.CharField(
        _("feedback types"), max_length=16, choices=Types.choices, default=Types.SAME
    )
    valences = models.JSONField(_("which types"), default=list, blank=True)
    min_valid_strides = models.PositiveIntegerField(
        _("fewest steps"),
        default=100,
        help_text=_("A session counts from so many valid steps with feedback on."),
    )
    min_minutes = models.PositiveSmallIntegerField(
        _("or fewest minutes"),
        null=True,
        blank=True,
        help_text=_("A session with fewer steps counts as well if it was walked so long."),
    )
    include_simulated = models.BooleanField(_("simulated sessions too"), default=False)
    period = models.CharField(
        _("period"), max_length=16, choices=Period.choices, default=Period.DAYS_30
    )
    period_from = models.DateField(_("from"), null=True, blank=True)
    period_to = models.DateField(_("to"), null=True, blank=True)
    frozen_on = models.DateField(
        _("frozen on"),
        null=True,
        blank=True,
        help_text=_(
            "For a report: the board stays as it was at the end of this day. Nobody enters it "
            "afterwards, and who leaves the boards leaves it."
        ),
    )
    display = models.CharField(
        _("rows"), max_length=16, choices=Display.choices, default=Display.NEIGHBORS
    )
    top_n = models.PositiveSmallIntegerField(
        _("how many of the best"),
        default=10,
        validators=[MinValueValidator(1), MaxValueValidator(50)],
    )
    total_goal = models.PositiveIntegerField(
        _("goal of the total"),
        null=True,
        blank=True,
        validators=[MinValueValidator(1)],
        help_text=_("Draws a bar that fills up to it."),
    )
    show_ranks = models.BooleanField(_("show places"), default=True)
    ties = models.CharField(
        _("equal figures"), max_length=16, choices=Ties.choices, default=Ties.STANDARD
    )
    tie_breaker = models.CharField(
        _("of equal figures, first"),
        max_length=32,
        choices=metric_choices(),
        blank=True,
        help_text=_("Who has more of this stands first; after that, who was earlier."),
    )
    names = models.CharField(
        _("names"), max_length=16, choices=Names.choices, default=Names.PSEUDONYM
    )
    min_participants = models.PositiveSmallIntegerField(
        _("fewest patients"),
        default=5,
        validators=[MinValueValidator(5)],
        help_text=_("With fewer, everyone sees the own sessions only."),
    )
    moment = models.CharField(
        _("shown"), max_length=16, choices=Moment.choices, default=Moment.AFTER_SESSION
    )

    built_to = models.BigIntegerField(
        null=True,
        editable=False,
        help_text="The patient whom building its rows has come to; nothing once they are built.",
    )

    class Meta(ClinicModel.Meta):
        verbose_name = _("leaderboard")
        verbose_name_plural = _("leaderboards")
        ordering: ClassVar = ["name"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "name"], name="board_name_once_per_clinic"),
            models.UniqueConstraint(
                fields=["name"], condition=Q(clinic__isnull=True), name="board_name_once_across"
            ),
            models.CheckConstraint(
                condition=~Q(period="dates")
                | Q(period_from__isnull=False, period_to__gte=models.F("period_from")),
                name="board_dates_in_order",
                violation_error_message=_("Give both dates, the first not after the second."),
            ),
            models.CheckConstraint(
                condition=Q(clinic__isnull=False, among__in=["self", "group", "clinic"])
                | Q(clinic__isnull=True, among="across"),
                name="board_across_is_the_hosts",
                violation_error_message=_(
                    "Boards across clinics are the host's, and a host has no other boards."
                ),
            ),
        ]

    def __str__(self) -> str:
        return self.name

    def save(self, *args: Any, **kwargs: Any) -> None:
        """Save the board, but not how far its rows are built: that may go on meanwhile."""
        if not self._state.adding and kwargs.get("update_fields") is None:
            names = {field.name for field in self._meta.concrete_fields if not field.primary_key}
            kwargs["update_fields"] = names - {"built_to"}
        super().save(*args, **kwargs)

    def clean(self) -> None:
        """Refuse boards that would mislead or expose somebody, with the cure at the field."""
        faults = dict(find_faults(self))
        if faults:
            raise ValidationError(faults)

    @property
    def is_being_built(self) -> bool:
        """Whether its rows are not yet what they should be: it is not shown then."""
        return self.built_to is not None

    @property
    def is_own(self) -> bool:
        """Whether it compares a patient with nobody else."""
        return self.among == self.Among.SELF

    @property
    def has_group(self) -> bool:
        """Whether its group decides who stands on it."""
        return self.among == self.Among.GROUP

    @property
    def agreed(self) -> list[str]:
        """What a patient must have agreed to, to stand on it: one of these."""
        if self.among == self.Among.ACROSS:
            return [Boards.ACROSS]
        total = [Boards.TOTAL] if self.display == self.Display.TOTAL else []
        return [*total, Boards.CLINIC, Boards.ACROSS]

    @property
    def makings(self) -> list[Any]:
        """What its rows follow from, besides sessions and patients."""
        fields = [field for field in self._meta.concrete_fields if field.name not in SHOWN_BY]
        return [self.agreed, *(getattr(self, field.attname) for field in fields)]

    @property
    def slugs(self) -> list[str]:
        """The feedback types that count; none means all."""
        return list(self.valences) if self.types == self.Types.CHOSEN else []

    def list_of(self, valence: str) -> str:
        """Give the list that a session of this type is on: one a type, or one for all ("")."""
        return valence if self.types == self.Types.SAME else ""


class BoardEntry(ScopedModel):
    """A patient's row on a board of several: what the sessions that count add up to.

    It follows from the sessions (`entries.py`) and is there to be found by index. ``key`` orders
    the rows: the greater, the better.
    """

    scope = Scope(clinic="patient__clinic")

    # No indexes of their own: those below begin with them.
    board = models.ForeignKey(
        Leaderboard, on_delete=models.CASCADE, related_name="entries", db_index=False
    )
    patient = models.ForeignKey(Patient, on_delete=models.CASCADE, related_name="+", db_index=False)
    valence = models.CharField(
        max_length=16, blank=True, choices=[(v.slug, _(v.label)) for v in VALENCES.values()]
    )
    figure = models.IntegerField(help_text="As it is shown: in whole numbers.")
    stake = models.IntegerField(null=True, help_text="What could be kept, where points are lost.")
    key = models.CharField(max_length=48)
    stale_on = models.DateField(null=True, help_text="When time alone alters it.")

    class Meta(ScopedModel.Meta):
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["patient", "board", "valence"], name="board_entry_once")
        ]
        indexes: ClassVar = [
            models.Index(fields=["board", "valence", "key"], name="entry_by_place"),
            models.Index(fields=["board", "stale_on"], name="entry_by_staleness"),
        ]

    def __str__(self) -> str:
        return f"{self.figure}"


class BoardCount(ScopedModel):
    """How many rows of a board have a figure: places are sums of these, never counts of rows."""

    scope = Scope(clinic="board__clinic")

    board = models.ForeignKey(
        Leaderboard, on_delete=models.CASCADE, related_name="counts", db_index=False
    )
    valence = models.CharField(max_length=16, blank=True)
    figure = models.IntegerField()
    rows = models.PositiveIntegerField()

    class Meta(ScopedModel.Meta):
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["board", "valence", "figure"], name="board_count_once")
        ]

    def __str__(self) -> str:
        return f"{self.figure}: {self.rows}"
