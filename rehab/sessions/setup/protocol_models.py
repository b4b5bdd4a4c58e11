"""What sessions are built from: measures, and protocols with their phases."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, ClassVar

from django.core.exceptions import ValidationError
from django.core.validators import RegexValidator
from django.db import models
from django.db.models import F, Q
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.feedback.translation import translate
from rehab.people.models import Clinic
from rehab.people.ranges import between
from rehab.people.scope import ClinicModel, Scope, ScopedModel
from rehab.people.web.refusals import format_refusal
from rehab.training import measures as rules
from rehab.training.closeness import CLOSE_WORDS, CloseSteps
from rehab.training.phases import PHASE_KINDS, Phase
from robot.wire.frames import NAME


def display_name(row: MeasureDefinition | Protocol) -> str:
    """Return the name of a row; that of a shared one is translated."""
    return row.name if row.clinic_id else gettext(row.name)


def _values_for(rule: type, row: models.Model) -> dict[str, Any]:
    """Return what a rule is made of: its fields, which the row has under the same names."""
    return {field.name: getattr(row, field.name) for field in fields(rule)}


class MeasureDefinition(ClinicModel):
    """A quantity of a stride that can be trained. Without a clinic it is shared by all."""

    scope = Scope(clinic="clinic", shared=True, host=Q(clinic__isnull=True))

    clinic = models.ForeignKey(
        Clinic,
        on_delete=models.CASCADE,
        related_name="measures",
        null=True,
        blank=True,
        verbose_name=_("clinic"),
    )
    slug = models.SlugField(_("slug"), max_length=32)
    name = models.CharField(_("name"), max_length=64)
    unit = models.CharField(_("unit"), max_length=16)
    higher_is_better = models.BooleanField(_("higher is better"), default=True)
    value_min = models.FloatField(_("value min"), help_text=_("Smallest value that can be real."))
    value_max = models.FloatField(_("value max"), help_text=_("Largest value that can be real."))
    goal_min = models.FloatField(_("goal min"), help_text=_("A goal lies above this."))
    goal_max = models.FloatField(_("goal max"), help_text=_("A goal lies at or below this."))
    first_goal = models.FloatField(
        _("first goal"),
        null=True,
        blank=True,
        help_text=_("Offered where a patient has no goal yet; the middle where left empty."),
    )
    channel = models.CharField(
        _("channel"),
        max_length=64,
        blank=True,
        validators=[
            RegexValidator(
                rf"^{NAME.pattern}\Z", _("Only letters, digits and . _ : - as sources send it.")
            )
        ],
        help_text=_(
            "Name of the extra value in the source's steps that holds it. Left empty, it is the "
            "value of the step itself."
        ),
    )

    class Meta(ClinicModel.Meta):
        verbose_name = _("measure")
        verbose_name_plural = _("measures")
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
                violation_error_message=_(
                    "Each smallest value must lie below the largest; goals lie above 0."
                ),
            ),
        ]

    def __str__(self) -> str:
        return f"{display_name(self)} [{self.unit}]"

    def to_rule(self) -> rules.Measure:
        """Return the measure in the form that the rules use."""
        return rules.Measure(**_values_for(rules.Measure, self))

    def clean(self) -> None:
        """Refuse what the rules refuse, with their message."""
        if None in (self.value_min, self.value_max, self.goal_min, self.goal_max):
            return  # the field itself has the error
        try:
            self.to_rule()
        except rules.InvalidSetting as problem:
            raise ValidationError(format_refusal(problem)) from problem


class Protocol(ClinicModel):
    """A list of phases that sessions are built from. Without a clinic it is shared by all."""

    scope = Scope(clinic="clinic", shared=True, host=Q(clinic__isnull=True))

    clinic = models.ForeignKey(
        Clinic,
        on_delete=models.CASCADE,
        related_name="protocols",
        null=True,
        blank=True,
        verbose_name=_("clinic"),
    )
    name = models.CharField(_("name"), max_length=64)
    description = models.TextField(_("description"), blank=True)
    wanted_hits = models.PositiveSmallIntegerField(
        _("target hit rate, % of steps"),
        null=True,
        blank=True,
        validators=between(1, 100, "%"),
        help_text=_("Filled in where a session is set up with it; left empty, it stays."),
    )
    close_percent = models.PositiveSmallIntegerField(
        _("close steps, % beyond the goal"),
        null=True,
        blank=True,
        validators=between(most=49, unit="%"),
        help_text=_(
            "Steps too close to the goal to call neither earn nor cost points. Leave empty to call "
            "every step a hit or a miss."
        ),
    )
    # Slugs of what the patient is asked after a session (sessions/questionnaires.py).
    questionnaires = models.JSONField(_("questionnaires"), default=list, blank=True)

    class Meta(ClinicModel.Meta):
        verbose_name = _("protocol")
        verbose_name_plural = _("protocols")
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
        return display_name(self)

    def to_rules(self) -> tuple[Phase, ...]:
        """Return the phases in the form that the rules use."""
        phases = sorted(self.phases.all(), key=lambda phase: phase.position)  # also if prefetched
        return tuple(phase.to_rule() for phase in phases)

    def close_steps(self, language: str) -> CloseSteps:
        """Return which steps count as close, with their words in a language."""
        part = None if self.close_percent is None else self.close_percent / 100
        return CloseSteps(part, translate(CLOSE_WORDS, language))


class ProtocolPhase(ScopedModel):
    """One phase of a protocol."""

    scope = Scope(clinic="protocol__clinic", shared=True, host=Q(protocol__clinic__isnull=True))

    protocol = models.ForeignKey(
        Protocol, on_delete=models.CASCADE, related_name="phases", verbose_name=_("protocol")
    )
    position = models.PositiveSmallIntegerField(_("position"))
    kind = models.CharField(
        _("kind"),
        max_length=16,
        choices=[(kind.slug, _(kind.label)) for kind in PHASE_KINDS.values()],
    )
    name = models.CharField(_("name"), max_length=64)
    feedback = models.BooleanField(
        _("feedback"), help_text=_("Whether the patient gets feedback in this phase.")
    )
    gain = models.FloatField(
        _("gain"),
        default=1.0,
        help_text=_("What is shown is this share of the measured value (0.5 to 1.5)."),
    )
    strides = models.PositiveIntegerField(
        _("strides"), null=True, blank=True, help_text=_("Ends after so many.")
    )
    seconds = models.FloatField(
        _("seconds"), null=True, blank=True, help_text=_("Ends after so many seconds.")
    )
    goal_percent = models.FloatField(
        _("goal"),
        null=True,
        blank=True,
        help_text=_("Goal from here on, % of baseline; left empty, it stays."),
    )
    robot = models.BooleanField(
        _("robot"), default=True, help_text=_("Whether the robot answers in this phase.")
    )
    rest_s = models.FloatField(
        _("rest"), null=True, blank=True, help_text=_("Pause after it, seconds; you end it.")
    )

    class Meta(ScopedModel.Meta):
        verbose_name = _("protocol phase")
        verbose_name_plural = _("protocol phases")
        ordering: ClassVar = ["protocol", "position"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["protocol", "position"], name="protocol_phase_position_once"
            )
        ]

    def __str__(self) -> str:
        return gettext(self.name)

    def to_rule(self) -> Phase:
        """Return the phase in the form that the rules use. Raises InvalidSetting."""
        return Phase(**_values_for(Phase, self))

    def clean(self) -> None:
        """Refuse what the rules refuse, with their message."""
        try:
            self.to_rule()
        except rules.InvalidSetting as problem:
            raise ValidationError(format_refusal(problem)) from problem
