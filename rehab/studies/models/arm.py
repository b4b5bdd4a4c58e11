"""The arms of a study, as its sessions are created from them."""

from __future__ import annotations

from typing import ClassVar

from django.db import models
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.feedback.translation import valence_choices
from rehab.people.scope import Scope, ScopedModel
from rehab.sessions.formatting import format_schedule
from rehab.sessions.setup.options import OPTIONS, build_parts
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.studies.arms import ArmRule, Condition
from rehab.studies.models.study import SCHEDULE_FIELDS, Study
from rehab.training.measures import InvalidSetting
from rehab.training.phases import Phase
from rehab.training.plans import ROBOT_LEVELS


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

    def baseline(self) -> tuple[Phase, ...]:
        """Return the first baseline alone, which a follow-up walks. Raises InvalidSetting."""
        found = next((phase for phase in self.phases() if phase.kind == "baseline"), None)
        if found is None:
            message = gettext("The protocol of arm %(code)s has no baseline for a follow-up.")
            raise InvalidSetting(message % {"code": self.code})
        return (found,)

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
