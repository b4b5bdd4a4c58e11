"""Leaderboards as PTs build them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import ClassVar

from django.core.exceptions import ValidationError
from django.db import models
from django.db.models import Exists, Q
from django.utils.translation import gettext_lazy as _

from rehab.boards.choices import (
    FEWEST_PATIENTS,
    Aggregation,
    CountedTypes,
    DisplayMode,
    NameStyle,
    Occasion,
    Participants,
    PeriodKind,
    TieRule,
    metric_choices,
)
from rehab.boards.validation import find_invalid_settings
from rehab.people.field_policy import personal_fields, retained
from rehab.people.models import BoardsConsent, Clinic, Patient
from rehab.people.ranges import between
from rehab.people.scope import ClinicModel, Scope

# How rows are shown, and when. All other fields decide what a board's rows are.
# What `display` changes about eligibility is in `accepted_levels`.
DISPLAY_FIELDS = frozenset(
    (
        *("id", "name", "active", "display", "top_n", "total_goal", "show_ranks", "ties", "names"),
        *("min_participants", "occasion"),
    )
)


@dataclass(frozen=True)
class BoardScope(Scope):
    """Boards of the own clinic, and those across clinics while it takes part in them."""

    def clinic_filter(self, clinic_id: int) -> Q:
        """Return the condition for boards that a member of this clinic may see."""
        takes_part = Exists(Clinic.everywhere.filter(pk=clinic_id, boards_across=True))
        return Q(clinic=clinic_id) | Q(takes_part, clinic__isnull=True)


class Leaderboard(ClinicModel):
    """Who is compared with whom, by what, over which time, and how it is shown.

    A board without a clinic is the host's and compares patients of all clinics that take part.
    """

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
        _("compare with"), max_length=16, choices=Participants.choices, default=Participants.SELF
    )
    group = models.ManyToManyField(
        Patient, related_name="+", blank=True, verbose_name=_("patients of the group")
    )
    metric = models.CharField(
        _("measure"), max_length=32, choices=metric_choices(), default="hit_rate"
    )
    higher_is_better = models.BooleanField(_("higher is better"), default=True)
    aggregation = models.CharField(
        _("a row is"), max_length=16, choices=Aggregation.choices, default=Aggregation.EACH
    )
    mean_of = models.PositiveSmallIntegerField(
        _("sessions in the mean"), default=3, validators=between(1)
    )
    types = models.CharField(
        _("feedback types"), max_length=16, choices=CountedTypes.choices, default=CountedTypes.SAME
    )
    valences = models.JSONField(_("which types"), default=list, blank=True)
    min_valid_strides = models.PositiveIntegerField(
        _("minimum steps"),
        default=100,
        help_text=_("A session counts if it has at least so many valid steps with feedback."),
    )
    min_minutes = models.PositiveSmallIntegerField(
        _("or minimum minutes"),
        null=True,
        blank=True,
        help_text=_("A session with fewer steps counts as well if it was walked so long."),
    )
    include_simulated = models.BooleanField(_("simulated sessions too"), default=False)
    period = models.CharField(
        _("period"), max_length=16, choices=PeriodKind.choices, default=PeriodKind.DAYS_30
    )
    period_from = models.DateField(_("from"), null=True, blank=True)
    period_to = models.DateField(_("to"), null=True, blank=True)
    frozen_on = models.DateField(
        _("frozen on"),
        null=True,
        blank=True,
        help_text=_(
            "For a report: the board stays as it was at the end of this day. No patient is "
            "added afterwards; patients who leave the boards are removed from it, too."
        ),
    )
    display = models.CharField(
        _("rows"), max_length=16, choices=DisplayMode.choices, default=DisplayMode.NEIGHBORS
    )
    top_n = models.PositiveSmallIntegerField(
        _("how many of the best"), default=10, validators=between(1, 50)
    )
    total_goal = models.PositiveIntegerField(
        _("goal of the total"),
        null=True,
        blank=True,
        validators=between(1),
        help_text=_("Draws a bar that fills up to it."),
    )
    show_ranks = models.BooleanField(_("show places"), default=True)
    ties = models.CharField(
        _("equal figures"), max_length=16, choices=TieRule.choices, default=TieRule.STANDARD
    )
    tie_breaker = models.CharField(
        _("of equal figures, first"),
        max_length=32,
        choices=metric_choices(),
        blank=True,
        help_text=_("Whoever has more of this comes first; after that, whoever was earlier."),
    )
    names = models.CharField(
        _("names"), max_length=16, choices=NameStyle.choices, default=NameStyle.PSEUDONYM
    )
    min_participants = models.PositiveSmallIntegerField(
        _("minimum patients"),
        default=FEWEST_PATIENTS,
        validators=between(FEWEST_PATIENTS),
        help_text=_("With fewer, everyone sees the own sessions only."),
    )
    occasion = models.CharField(
        _("shown"), max_length=16, choices=Occasion.choices, default=Occasion.AFTER_SESSION
    )

    # Of the group's rows. By then the patient has no name.
    personal = personal_fields(
        {"group": retained("who could be on a board", shown=True, research=False)}
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

    def clean(self) -> None:
        """Refuse boards that would mislead or expose somebody, with the cure at the field."""
        if errors := dict(find_invalid_settings(self)):
            raise ValidationError(errors)
        if (other := self._find_reverse()) is not None:
            message = _(
                "“%(board)s” ranks by the same measure the other way round: together they would "
                "show everybody, the last half too. Choose the same order, or switch that one off."
            )
            raise ValidationError({"higher_is_better": message % {"board": other.name}})

    def _find_reverse(self) -> Leaderboard | None:
        """Return a board that shows the half of the patients that this one does not."""
        if self.is_own or not self.active or self.display == DisplayMode.TOTAL:
            return None
        others = Leaderboard.everywhere.filter(
            Q(clinic=self.clinic_id) | Q(clinic__isnull=True),
            active=True,
            metric=self.metric,
            higher_is_better=not self.higher_is_better,
        )
        ranked = others.exclude(among=Participants.SELF).exclude(display=DisplayMode.TOTAL)
        return ranked.exclude(pk=self.pk).first()

    @property
    def is_own(self) -> bool:
        """Whether it compares a patient's own sessions only."""
        return self.among == Participants.SELF

    @property
    def has_group(self) -> bool:
        """Whether only the patients of its group can be on it."""
        return self.among == Participants.GROUP

    @property
    def accepted_levels(self) -> list[str]:
        """The levels of agreement (`Patient.boards`) with which a patient may be on it."""
        if self.among == Participants.ACROSS:
            return [BoardsConsent.ACROSS]
        total = [BoardsConsent.TOTAL] if self.display == DisplayMode.TOTAL else []
        return [*total, BoardsConsent.CLINIC, BoardsConsent.ACROSS]

    @property
    def definition(self) -> str:
        """The values that its results depend on, besides sessions, patients and its group."""
        fields = [field for field in self._meta.concrete_fields if field.name not in DISPLAY_FIELDS]
        values = {field.attname: getattr(self, field.attname) for field in fields}
        return json.dumps(values | {"levels": self.accepted_levels}, default=str)

    @property
    def counted_valences(self) -> list[str]:
        """The valences that count; an empty list means all."""
        return list(self.valences) if self.types == CountedTypes.CHOSEN else []

    def list_key(self, valence: str) -> str:
        """Return the list that sessions of a valence are ranked in: its own, or "" for all."""
        return valence if self.types == CountedTypes.SAME else ""
