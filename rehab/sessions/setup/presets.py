"""Presets: set-ups stored under a name, to fill in the set-up form with one tap."""

from __future__ import annotations

from typing import Any, ClassVar

from django.core.exceptions import ValidationError
from django.db import models
from django.utils.text import capfirst
from django.utils.translation import gettext, gettext_noop
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Clinic, User
from rehab.people.ranges import between
from rehab.people.scope import ClinicModel, Scope
from rehab.people.web.refusals import format_refusal
from rehab.sessions.formatting import (
    ROBOT_LEVEL_LABELS,
    SIMULATED_PREFIX,
    format_quantity,
    format_rate,
)
from rehab.sessions.setup.answers import (
    ADAPTATIONS,
    CUE_RULES,
    SCHEDULES,
    USUAL_ANSWERS,
    read_adaptation,
    read_cue_timing,
    read_schedule,
)
from rehab.sessions.setup.gestures import DEFAULT_GESTURE, known_gesture_choices
from rehab.sessions.setup.protocols import MeasureDefinition, Protocol
from rehab.sessions.setup.sources import LIVE
from rehab.sources.synthetic import PROFILES
from rehab.training.cueing import COUNT_MAX, REST_MAX_S, WINDOW_MAX_S, WINDOW_MIN_S
from rehab.training.goals import GoalRule, Target
from rehab.training.measures import InvalidSetting
from rehab.training.plans import ROBOT_LEVELS, SessionPlan
from rehab.training.schedules import INTERVAL_MAX
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
    measure = models.ForeignKey(
        MeasureDefinition,
        on_delete=models.CASCADE,
        related_name="presets",
        verbose_name=_("measure"),
    )
    goal_by = models.CharField(
        _("goal is given as"),
        max_length=8,
        choices=[("value", _("value")), ("percent", _("% of baseline"))],
        default="value",
    )
    goal_value = models.FloatField(_("goal, in the measure's unit"), null=True, blank=True)
    goal_percent = models.FloatField(_("goal, % of baseline"), null=True, blank=True)
    wanted_hits = models.PositiveSmallIntegerField(
        _("wanted hits, % of the steps"),
        null=True,
        blank=True,
        validators=between(1, 100, "%"),
    )
    minutes = models.PositiveSmallIntegerField(
        _("planned minutes"),
        null=True,
        blank=True,
        validators=between(1, 240, _("minutes")),
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
    robot_above = models.CharField(_("after strong steps"), max_length=64, default=DEFAULT_GESTURE)
    robot_below = models.CharField(_("after weak steps"), max_length=64, default=DEFAULT_GESTURE)
    robot_threshold = models.PositiveSmallIntegerField(
        _("robot acts from, % of the goal"),
        default=USUAL_ANSWERS["robot_threshold"],
        validators=between(1, 200, "%"),
    )
    robot_answers = models.CharField(
        _("robot answers"), max_length=16, choices=CUE_RULES, default=USUAL_ANSWERS["robot_answers"]
    )
    robot_window = models.FloatField(
        _("robot’s window, in seconds"),
        default=USUAL_ANSWERS["robot_window"],
        validators=between(WINDOW_MIN_S, WINDOW_MAX_S, "s"),
    )
    robot_count = models.PositiveSmallIntegerField(
        _("steps that the robot answers"),
        default=USUAL_ANSWERS["robot_count"],
        validators=between(1, COUNT_MAX),
    )
    robot_rest = models.FloatField(
        _("robot’s rest, in seconds"),
        default=USUAL_ANSWERS["robot_rest"],
        validators=between(0, REST_MAX_S, "s"),
    )
    schedule = models.CharField(
        _("feedback comes"), max_length=16, choices=SCHEDULES, default=USUAL_ANSWERS["schedule"]
    )
    schedule_steps = models.PositiveSmallIntegerField(
        _("steps between feedback"),
        default=USUAL_ANSWERS["schedule_steps"],
        validators=between(1, INTERVAL_MAX),
    )
    schedule_band = models.PositiveSmallIntegerField(
        _("band without feedback, ± % of the goal"),
        default=USUAL_ANSWERS["schedule_band"],
        validators=between(1, 50, "%"),
    )
    goal_follows = models.CharField(
        _("the goal"), max_length=16, choices=ADAPTATIONS, default=USUAL_ANSWERS["goal_follows"]
    )
    goal_asks = models.BooleanField(_("ask before the baseline’s goal counts"), default=False)
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
        protocol, measure = getattr(self, "protocol", None), getattr(self, "measure", None)
        if protocol is None or measure is None:
            return  # the field itself has the error
        if self.valence not in VALENCES or self.robot not in ROBOT_LEVELS:
            return  # the field itself has the error
        by_value, answers = self.goal_by == "value", self.answers
        if None in answers.values():
            return  # the field itself has the error
        try:
            SessionPlan(
                measure=measure.to_rule(),
                valence=find_valence(self.valence),
                phases=protocol.to_rules(),
                trained_side=Side.LEFT,
                goal=GoalRule(
                    self.goal_value if by_value else None, None if by_value else self.goal_percent
                ),
                target=Target(self.wanted_hits / 100 if self.wanted_hits else None),
                robot_intensity=ROBOT_LEVELS[self.robot],
                activation_threshold=self.robot_threshold / 100,
                cue_timing=read_cue_timing(answers),
                schedule=read_schedule(answers),
                adaptation=read_adaptation(answers),
            )
        except InvalidSetting as problem:
            raise ValidationError(format_refusal(problem)) from problem

    @property
    def answers(self) -> dict[str, Any]:
        """When robot and page answer, and whether the goal follows."""
        return {name: getattr(self, name) for name in USUAL_ANSWERS}

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
            return format_quantity(self.goal_value, self.measure.unit)
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
            "measure": self.measure,
            "goal_by": self.goal_by,
            "wanted_hits": self.wanted_hits,
            "minutes": self.minutes,
            "protocol": self.protocol,
            "robot": self.robot,
            "robot_above": self.robot_above if self.robot_above in known else DEFAULT_GESTURE,
            "robot_below": self.robot_below if self.robot_below in known else DEFAULT_GESTURE,
        }
        initial |= self.answers
        goal = {"goal_value": self.goal_value, "goal_percent": self.goal_percent}
        initial |= {name: value for name, value in goal.items() if value is not None}
        return initial | ({"source": self.source} if self.source else {})
