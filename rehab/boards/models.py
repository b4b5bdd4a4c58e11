"""Leaderboards as PTs build them. Ranking reads these fields; here they are only kept valid."""

from __future__ import annotations

from typing import Any, ClassVar

from django.core.exceptions import ValidationError
from django.core.validators import MinValueValidator
from django.db import models
from django.db.models import Q

from rehab.people.models import Clinic
from rehab.people.scope import ClinicRow, Scope
from rehab.training.metrics import METRICS
from rehab.training.valences import VALENCES

# Metrics whose range depends on the feedback type: one board must not mix types by them.
TYPED_METRICS = frozenset({"score", "points_per_100_steps"})


class Leaderboard(ClinicRow):
    """Who is compared with whom, by what, over which time, and how it is shown."""

    class Among(models.TextChoices):
        """Whose sessions are on the board."""

        SELF = "self", "The patient's own sessions"
        CLINIC = "clinic", "Patients of the clinic"

    class Types(models.TextChoices):
        """Which feedback types are on the board."""

        SAME = "same", "The type of the session at hand"
        CHOSEN = "chosen", "The types chosen below"
        ALL = "all", "All types"

    class Entry(models.TextChoices):
        """What stands in a row."""

        EACH = "each", "Each session"
        BEST = "best", "Best session of each patient"
        LATEST = "latest", "Latest session of each patient"
        MEAN = "mean", "Mean of the last sessions of each patient"
        SUM = "sum", "Sum over the period for each patient"

    class Period(models.TextChoices):
        """Which sessions count."""

        ALL = "all", "All time"
        DAYS_30 = "days_30", "Last 30 days"
        WEEK = "week", "This week"
        MONTH = "month", "This month"
        DATES = "dates", "Between two dates"

    class Ties(models.TextChoices):
        """How equal figures are ranked."""

        STANDARD = "standard", "1, 2, 2, 4"
        DENSE = "dense", "1, 2, 2, 3"
        EARLIER = "earlier", "Shared place, earlier date first"

    class Display(models.TextChoices):
        """Which rows are shown."""

        NEIGHBORS = "neighbors", "Me and two neighbors on each side"
        TOP = "top", "The best"
        TOP_AND_ME = "top_and_me", "The best, and me"
        TOTAL = "total", "The clinic's total"

    class Names(models.TextChoices):
        """What patients are called."""

        PSEUDONYM = "pseudonym", "Pseudonym"
        INITIALS = "initials", "Initials"
        CODE = "code", "Code"

    class Moment(models.TextChoices):
        """When it is shown."""

        AFTER_SESSION = "after_session", "After each session"
        WAITING = "waiting", "On the waiting screen"
        PT_ONLY = "pt_only", "To the PT only"

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(Clinic, on_delete=models.CASCADE, related_name="leaderboards")
    name = models.CharField(max_length=64)
    among = models.CharField(max_length=16, choices=Among.choices, default=Among.SELF)
    types = models.CharField(max_length=16, choices=Types.choices, default=Types.SAME)
    valences = models.JSONField(
        default=list, blank=True, help_text='Chosen types, as a list: ["positive", "binary"].'
    )
    metric = models.CharField(
        max_length=32,
        choices=[(metric.slug, metric.label) for metric in METRICS.values()],
        default="hit_rate",
    )
    entry = models.CharField(max_length=16, choices=Entry.choices, default=Entry.EACH)
    mean_of = models.PositiveSmallIntegerField(default=3, validators=[MinValueValidator(1)])
    min_valid_strides = models.PositiveIntegerField(default=100)
    include_simulated = models.BooleanField(default=False)
    period = models.CharField(max_length=16, choices=Period.choices, default=Period.DAYS_30)
    period_from = models.DateField(null=True, blank=True)
    period_to = models.DateField(null=True, blank=True)
    ties = models.CharField(max_length=16, choices=Ties.choices, default=Ties.STANDARD)
    display = models.CharField(max_length=16, choices=Display.choices, default=Display.NEIGHBORS)
    top_n = models.PositiveSmallIntegerField(default=10, validators=[MinValueValidator(1)])
    show_ranks = models.BooleanField(default=True)
    names = models.CharField(max_length=16, choices=Names.choices, default=Names.PSEUDONYM)
    min_participants = models.PositiveSmallIntegerField(
        default=5,
        validators=[MinValueValidator(5)],
        help_text="With fewer patients the board falls back to the patient's own sessions.",
    )
    moment = models.CharField(max_length=16, choices=Moment.choices, default=Moment.AFTER_SESSION)
    active = models.BooleanField(default=True)

    class Meta(ClinicRow.Meta):
        ordering: ClassVar = ["name"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "name"], name="board_name_once_per_clinic"),
            models.CheckConstraint(
                condition=~Q(period="dates")
                | Q(period_from__isnull=False, period_to__gte=models.F("period_from")),
                name="board_dates_in_order",
                violation_error_message="Give both dates, the first not after the second.",
            ),
        ]

    def __str__(self) -> str:
        return self.name

    def clean(self) -> None:
        """Refuse boards that would rank by feedback type, or several rows a person in a group."""
        errors: dict[str, Any] = {}
        chosen = self.valences
        if not isinstance(chosen, list) or not all(slug in VALENCES for slug in chosen):
            errors["valences"] = f"Give a list of these types: {', '.join(VALENCES)}."
        elif self.types == self.Types.CHOSEN and not chosen:
            errors["valences"] = "Choose at least one type."
        elif self.metric in TYPED_METRICS:
            mixed = self.types == self.Types.ALL or len(set(chosen)) > 1
            if mixed and self.types != self.Types.SAME:
                errors["metric"] = (
                    "Points of different feedback types cannot be compared: negative ones are "
                    "never above 0. Choose the hit rate, or a single type."
                )
            elif self.types == self.Types.CHOSEN and chosen == ["explicit"]:
                errors["metric"] = "Explicit feedback has no points. Choose the hit rate."
        if self.among != self.Among.SELF and self.entry == self.Entry.EACH:
            errors["entry"] = "A board of several patients shows one row for each of them."
        if errors:
            raise ValidationError(errors)
