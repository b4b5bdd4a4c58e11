"""Gestures that a clinic composes. `robot.motion` validates them."""

from __future__ import annotations

import math
from typing import Any, ClassVar

from django.core.exceptions import ValidationError
from django.db import models
from django.utils.translation import gettext_lazy as _

from rehab.gestures.tracks import read_tracks
from rehab.people.models import Clinic
from rehab.people.scope import ClinicModel, Scope, ScopedModel
from rehab.people.web.refusals import format_refusal
from robot.motion.composed_gestures import Move, check_name, to_data
from robot.motion.gesture_errors import BadGesture


class ComposedGesture(ClinicModel):
    """Steps that a robot of the clinic can perform where a session's cue names them."""

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="gestures", verbose_name=_("clinic")
    )
    name = models.SlugField(
        _("name"), max_length=32, help_text=_("Letters, digits and hyphens: slow-wave.")
    )
    lights = models.TextField(
        _("lights"),
        blank=True,
        help_text=_(
            "A line each: second, first and second light (off, green, orange): 0.5 green off. The "
            "robot moves from 0.5 s on. Empty: one orange light."
        ),
    )
    notes = models.TextField(
        _("notes"),
        blank=True,
        help_text=_(
            "A line each: second, pitch in Hz and duration in s, or one of the robot's melodies: "
            "0.5 440 0.2, or 1 button. Nothing sounds where the robot is gentle. With both empty: "
            "one note."
        ),
    )

    class Meta(ClinicModel.Meta):
        verbose_name = _("gesture")
        verbose_name_plural = _("gestures")
        ordering: ClassVar = ["name"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "name"], name="gesture_name_once_per_clinic")
        ]

    def __str__(self) -> str:
        return self.name

    def clean(self) -> None:
        """Refuse the names of gestures that every robot knows."""
        try:
            check_name(self.name)
        except BadGesture as problem:
            raise ValidationError({"name": format_refusal(problem)}) from problem
        read_tracks(self.lights, self.notes)

    def to_moves(self) -> list[Move]:
        """Return the steps as the robot's moves."""
        return [step.to_move() for step in self.steps.order_by("position")]

    def to_data(self) -> dict[str, Any]:
        """Return the gesture as it is sent to a robot."""
        return to_data(self.name, self.to_moves()) | read_tracks(self.lights, self.notes)


class GestureStep(ScopedModel):
    """One step of a gesture: turn on the spot, go straight on, wait."""

    scope = Scope(clinic="gesture__clinic")

    gesture = models.ForeignKey(
        ComposedGesture, on_delete=models.CASCADE, related_name="steps", verbose_name=_("gesture")
    )
    position = models.PositiveSmallIntegerField(
        _("number"), help_text=_("Empty: after the row above.")
    )
    turn_deg = models.FloatField(
        _("turn (°)"), default=0.0, help_text=_("First; to the left above 0.")
    )
    forward_m = models.FloatField(_("forward (m)"), default=0.0, help_text=_("Then; back below 0."))
    hold_s = models.FloatField(_("pause (s)"), default=0.0, help_text=_("At the end."))
    pace = models.FloatField(
        _("pace"), default=1.0, help_text=_("Share of the full speed, 0.2 to 1.")
    )
    within_s = models.FloatField(
        _("time (s)"),
        null=True,
        blank=True,
        help_text=_("It stops if it takes longer. Empty: as usual."),
    )

    class Meta(ScopedModel.Meta):
        verbose_name = _("step")
        verbose_name_plural = _("steps")
        ordering: ClassVar = ["gesture", "position"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["gesture", "position"], name="gesture_step_position_once"
            )
        ]

    def __str__(self) -> str:
        return str(_("Step %(number)d") % {"number": self.position})

    def to_move(self) -> Move:
        """Return the step as a robot's move."""
        return Move(
            turn_rad=math.radians(self.turn_deg),
            forward_m=self.forward_m,
            hold_s=self.hold_s,
            pace=self.pace,
            within_s=self.within_s,
        )
