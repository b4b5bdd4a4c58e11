"""Presets: set-ups stored under a name, to fill in the set-up form with one tap."""

from __future__ import annotations

from typing import Any, ClassVar

from django.core.exceptions import ValidationError
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db import models
from django.utils.text import capfirst
from django.utils.translation import gettext, gettext_noop
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Clinic, User
from rehab.people.scope import ClinicModel, Scope
from rehab.people.web.refusals import format_refusal
from rehab.sessions.formatting import (
    ROBOT_LEVEL_LABELS,
    SIMULATED_PREFIX,
    format_quantity,
    format_rate,
)
from rehab.sessions.setup.gestures import DEFAULT_GESTURE, known_gesture_choices
from rehab.sessions.setup.protocols import Protocol
from rehab.sessions.setup.sources import LIVE
from rehab.sources.synthetic import PROFILES
from rehab.training.goals import GoalRule, Target
from rehab.training.measures import A2, InvalidSetting
from rehab.training.plans import ROBOT_LEVELS, SessionPlan
from rehab.training.steps import Side
from rehab.training.valences import VALENCES, find_valence

NAME_TAKEN = gettext_noop("A preset of this name exists. Choose another name.")


class Preset(ClinicModel):
    """A set-up without its patient, leg and station."""

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="presets", verbose_name=_("clinic")
    )
    name = models.CharField(_("name"), max_length=64)
    valence = models.CharField(
        _("feedback type"), max_length=16, choices=[(v.slug, _(v.label)) for v in VALENCES.values()]
    )
    goal_by = models.CharField(
        _("goal is given as"),
        max_length=8,
        choices=[("value", A2.unit), ("percent", _("% of baseline"))],
        default="value",
    )
    goal_value = models.FloatField(_("goal, W/kg"), null=True, blank=True)
    goal_percent = models.FloatField(_("goal, % of baseline"), null=True, blank=True)
    wanted_hits = models.PositiveSmallIntegerField(
        _("wanted hits, % of the steps"),
        null=True,
        blank=True,
        validators=[MinValueValidator(1), MaxValueValidator(100)],
    )
    minutes = models.PositiveSmallIntegerField(
        _("planned minutes"),
        null=True,
        blank=True,
        validators=[MinValueValidator(1), MaxValueValidator(240)],
    )
    protocol = models.ForeignKey(
        Protocol, on_delete=models.CASCADE, related_name="presets", verbose_name=_("protocol")
    )
    robot = models.CharField(
        _("robot"),
        max_length=16,
        choices=[(level, capfirst(ROBOT_LEVEL_LABELS[level])) for level in ROBOT_LEVELS],
        default="normal",
    )
    robot_above = models.CharField(
        _("after five strong seconds"), max_length=64, default=DEFAULT_GESTURE
    )
    robot_below = models.CharField(
        _("after five weak seconds"), max_length=64, default=DEFAULT_GESTURE
    )
    source = models.CharField(
        _("steps come from"),
        max_length=64,
        blank=True,
        choices=[
            ("", _("As last time")),
            (LIVE, _("Live sensor")),
            *((f"synthetic {name}", _(SIMULATED_PREFIX + name)) for name in PROFILES),
        ],
    )

    class Meta(ClinicModel.Meta):
        verbose_name = _("preset")
        verbose_name_plural = _("presets")
        ordering: ClassVar = ["name"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["clinic", "name"],
                name="preset_name_once_per_clinic",
                violation_error_message=_(NAME_TAKEN),
            )
        ]

    def __str__(self) -> str:
        return self.name

    def clean(self) -> None:
        """Refuse what could not be walked, with the rules' own message."""
        protocol = getattr(self, "protocol", None)
        if protocol is None or self.valence not in VALENCES or self.robot not in ROBOT_LEVELS:
            return  # the field itself has the error
        by_value = self.goal_by == "value"
        try:
            SessionPlan(
                measure=A2,
                valence=find_valence(self.valence),
                phases=protocol.to_rules(),
                trained_side=Side.LEFT,
                goal=GoalRule(
                    self.goal_value if by_value else None, None if by_value else self.goal_percent
                ),
                target=Target(self.wanted_hits / 100 if self.wanted_hits else None),
                robot_intensity=ROBOT_LEVELS[self.robot],
            )
        except InvalidSetting as problem:
            raise ValidationError(format_refusal(problem)) from problem

    @property
    def summary(self) -> str:
        """Valence, goal and duration in a few words."""
        return " · ".join(
            filter(None, (self.get_valence_display(), self.goal_label, self.duration_label))
        )

    @property
    def goal_label(self) -> str:
        """The goal as text."""
        if self.goal_by == "value":
            return format_quantity(self.goal_value, A2.unit)
        share = format_rate(self.goal_percent / 100 if self.goal_percent else None)
        return gettext("%(share)s of baseline") % {"share": share}

    @property
    def duration_label(self) -> str:
        """The planned duration as text."""
        return gettext("%(count)s min") % {"count": self.minutes} if self.minutes else ""

    def to_initial(self, by: User) -> dict[str, Any]:
        """Return initial values for the set-up form; a deleted gesture becomes the default one."""
        known = known_gesture_choices(by)
        initial: dict[str, Any] = {
            "valence": self.valence,
            "goal_by": self.goal_by,
            "wanted_hits": self.wanted_hits,
            "minutes": self.minutes,
            "protocol": self.protocol,
            "robot": self.robot,
            "robot_above": self.robot_above if self.robot_above in known else DEFAULT_GESTURE,
            "robot_below": self.robot_below if self.robot_below in known else DEFAULT_GESTURE,
        }
        goal = {"goal_value": self.goal_value, "goal_percent": self.goal_percent}
        initial |= {name: value for name, value in goal.items() if value is not None}
        return initial | ({"source": self.source} if self.source else {})
