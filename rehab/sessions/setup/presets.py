"""Presets: set-ups stored under a name, to fill in the set-up form with one tap."""

from __future__ import annotations

from typing import Any, ClassVar

from django import forms
from django.core.exceptions import ValidationError
from django.db import models
from django.utils.translation import gettext, gettext_noop
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Clinic, User
from rehab.people.scope import ClinicModel, Scope
from rehab.people.web.refusals import format_refusal
from rehab.sessions.formatting import format_duration, format_quantity, format_rate
from rehab.sessions.setup.cue_gestures import DEFAULT_GESTURE, known_gesture_choices
from rehab.sessions.setup.option import OptionForm
from rehab.sessions.setup.options import build_parts, preset_options
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.sessions.setup.sources import LIVE, SIMULATED
from rehab.sources.synthetic import PROFILES
from rehab.training.measures import InvalidSetting
from rehab.training.plans import SessionPlan
from rehab.training.steps import Side
from rehab.training.valences import find_valence

NAME_TAKEN = gettext_noop("A preset of this name exists. Choose another name.")
GESTURES = ("robot_above", "robot_below")
# No preset names a recording, which lies on one machine.
SOURCES = ("", LIVE, *(f"{SIMULATED}{name}" for name in PROFILES))


class PresetOptionForm(OptionForm):
    """The options of a preset, with the choices of a user; without one any gesture is accepted."""

    def __init__(self, *args: Any, by: User | None = None, **others: Any) -> None:
        super().__init__(*args, options=preset_options(), by=by, **others)
        source: Any = self.fields["source"]
        words = dict(source.choices) | {"": _("As last time")}
        source.required, source.choices = False, [(name, words[name]) for name in SOURCES]
        source.widget = forms.Select(choices=source.choices)
        if by is None:
            self.fields |= {name: forms.CharField(max_length=64) for name in GESTURES}


class Preset(ClinicModel):
    """A set-up without its patient, leg and station.

    ``options`` has the value of each set-up option by its name, as the set-up form takes it; one
    that was added to GARRY since is as usual.
    """

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="presets", verbose_name=_("clinic")
    )
    name = models.CharField(_("name"), max_length=64)
    measure = models.ForeignKey(
        MeasureDefinition,
        on_delete=models.CASCADE,
        related_name="presets",
        verbose_name=_("measure"),
    )
    protocol = models.ForeignKey(
        Protocol, on_delete=models.CASCADE, related_name="presets", verbose_name=_("protocol")
    )
    options = models.JSONField(_("options"), default=dict)

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
        form = PresetOptionForm(self.values)
        if not form.is_valid():
            found = form.errors.items()
            raise ValidationError(
                [f"{form[name].label}: {each}" for name, errors in found for each in errors]
            )
        self.options = form.chosen()
        protocol, measure = getattr(self, "protocol", None), getattr(self, "measure", None)
        if protocol is None or measure is None:
            return  # the field itself has the error
        try:
            SessionPlan(
                measure=measure.to_rule(),
                valence=find_valence(self.options["valence"]),
                phases=protocol.to_rules(),
                trained_side=Side.LEFT,
                **build_parts(self.options),
            )
        except InvalidSetting as problem:
            raise ValidationError(format_refusal(problem)) from problem

    @property
    def values(self) -> dict[str, Any]:
        """The value of each option that presets have."""
        offered = {option.name: option.default for option in preset_options()}
        return {name: self.options.get(name, usual) for name, usual in offered.items()}

    @property
    def valence_label(self) -> str:
        """The feedback type as text."""
        return gettext(find_valence(self.values["valence"]).label)

    @property
    def goal_label(self) -> str:
        """The goal as text."""
        values = self.values
        if values["goal_by"] == "value":
            return format_quantity(values["goal_value"], self.measure.unit)
        percent = values["goal_percent"]
        share = format_rate(percent / 100 if percent else None)
        return gettext("%(share)s of baseline") % {"share": share}

    @property
    def summary(self) -> str:
        """Valence, goal and duration in a few words."""
        minutes = self.values["minutes"]
        duration = format_duration(60 * minutes) if minutes else ""
        return " · ".join(filter(None, (self.valence_label, self.goal_label, duration)))

    def to_initial(self, by: User) -> dict[str, Any]:
        """Return initial values for the set-up form; a deleted gesture becomes the default one."""
        known = known_gesture_choices(by)
        unset = [name for name in ("goal_value", "goal_percent", "source") if not self.values[name]]
        initial = {name: value for name, value in self.values.items() if name not in unset}
        initial |= {name: DEFAULT_GESTURE for name in GESTURES if initial[name] not in known}
        return initial | {"measure": self.measure, "protocol": self.protocol}
