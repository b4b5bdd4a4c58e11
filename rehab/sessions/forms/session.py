"""The form that sets a session up."""

from __future__ import annotations

from typing import Any

from django import forms
from django.conf import settings
from django.core.exceptions import ValidationError
from django.utils.text import capfirst
from django.utils.translation import gettext_lazy as _

from rehab.people.models import SIDES, Patient, User
from rehab.people.ranges import NumberField, WholeNumberField
from rehab.people.web.refusals import format_refusal
from rehab.sessions.formatting import ROBOT_LEVEL_LABELS, format_source
from rehab.sessions.forms.answers import AnswerFields
from rehab.sessions.forms.initial import usual_measure
from rehab.sessions.forms.walking import WalkingFields
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import (
    SessionRequest,
    StationTaken,
    check_station_is_free,
    create_session,
)
from rehab.sessions.setup.answers import (
    read_adaptation,
    read_cue_timing,
    read_schedule,
)
from rehab.sessions.setup.gestures import (
    cue_from_choices,
    robot_gesture_choices,
)
from rehab.sessions.setup.protocols import MeasureDefinition, Protocol
from rehab.sessions.setup.sources import SIMULATED, build_source_args, source_choices
from rehab.sources.recording import RecordingError, read_recording
from rehab.sources.recording.source import holds_signals
from rehab.stations.models import Station
from rehab.training import measures as rules
from rehab.training.goals import GoalRule, Target
from rehab.training.measures import A2, InvalidSetting
from rehab.training.plans import ROBOT_LEVELS
from rehab.training.steps import Side
from rehab.training.valences import VALENCES


class SessionForm(WalkingFields, AnswerFields):
    """The set-up of one patient's session. With its initial values it can be sent as it is.

    Attributes
    ----------
    taken_by
        The open session at the chosen station, which was refused for it.
    """

    valence = forms.ChoiceField(choices=[(v.slug, _(v.label)) for v in VALENCES.values()])
    measure: forms.ModelChoiceField[MeasureDefinition] = forms.ModelChoiceField(
        queryset=None, empty_label=None, required=False
    )
    goal_by = forms.ChoiceField(choices=[("value", _("value")), ("percent", _("% of baseline"))])
    goal_value = NumberField(required=False)
    goal_percent = NumberField(least=50, most=200, unit="%", required=False)
    wanted_hits = WholeNumberField(least=1, most=100, unit="%", required=False)
    minutes = WholeNumberField(least=1, most=240, unit=_("minutes"), required=False)
    protocol: forms.ModelChoiceField[Protocol] = forms.ModelChoiceField(
        queryset=None, empty_label=None, widget=forms.RadioSelect
    )
    station: forms.ModelChoiceField[Station] = forms.ModelChoiceField(
        queryset=None, empty_label=None, widget=forms.RadioSelect
    )
    source = forms.ChoiceField(widget=forms.RadioSelect)
    trained_side = forms.ChoiceField(choices=SIDES, widget=forms.RadioSelect)
    robot = forms.ChoiceField(
        choices=[(level, capfirst(ROBOT_LEVEL_LABELS[level])) for level in ROBOT_LEVELS],
        widget=forms.RadioSelect,
    )
    robot_above = forms.ChoiceField()
    robot_below = forms.ChoiceField()

    def __init__(self, *args: Any, patient: Patient, by: User, **options: Any) -> None:
        super().__init__(*args, **options)
        self.patient, self.by = patient, by
        self.taken_by: TrainingSession | None = None
        fields: dict[str, Any] = self.fields
        fields["measure"].queryset = MeasureDefinition.objects.visible_to(by)
        fields["protocol"].queryset = Protocol.objects.visible_to(by)
        fields["station"].queryset = Station.objects.visible_to(by)
        fields["source"].choices = [
            (name, format_source(label)) for name, label in source_choices()
        ]
        fields["robot_above"].choices = fields["robot_below"].choices = robot_gesture_choices(by)

    @property
    def chosen_measure(self) -> rules.Measure:
        """The measure that the form shows, A2 where it names none that exists."""
        field: Any = self.fields["measure"]
        try:
            row: MeasureDefinition | None = field.clean(self["measure"].value())
        except ValidationError:
            row = None
        return A2 if row is None else row.to_rule()

    def clean_measure(self) -> MeasureDefinition:
        """Return the measure, A2 where none is named."""
        return self.cleaned_data["measure"] or usual_measure(self.by)

    def clean_station(self) -> Station:
        """Return the station. Refuses one with an open session."""
        station: Station = self.cleaned_data["station"]
        try:
            check_station_is_free(station)
        except StationTaken as problem:
            self.taken_by = problem.session
            raise ValidationError(format_refusal(problem)) from problem
        return station

    def clean_source(self) -> str:
        """Return the source. Refuses a recording that cannot be played."""
        source: str = self.cleaned_data["source"]
        kind, _between, name = source.partition(" ")
        if kind == "recording":
            file = settings.DATA_DIR / "recordings" / name
            if holds_signals(file):
                if self.patient.body_mass_kg is None:
                    raise ValidationError(
                        _(
                            "%(file)s holds raw signals, and A2 is power per kilogram: give "
                            "%(patient)s's body mass first."
                        ),
                        params={"file": name, "patient": self.patient.nickname},
                    )
                return source
            try:
                read_recording(file)
            except RecordingError as problem:
                raise ValidationError(str(problem)) from problem
        return source

    def clean(self) -> dict[str, Any]:
        """Return the cleaned data. Refuses a goal and a source that do not fit the measure."""
        data: dict[str, Any] = super().clean() or {}
        measure, goal = data.get("measure"), data.get("goal_value")
        if measure is None:
            return data
        if data.get("goal_by") == "value" and goal is not None:
            try:
                measure.to_rule().check_goal(goal)
            except InvalidSetting as problem:
                self.add_error("goal_value", format_refusal(problem))
        if measure.slug != A2.slug and data.get("source", "").startswith(SIMULATED):
            message = _("Simulated patients walk with A2 only. Choose another source, or A2.")
            self.add_error("source", message)
        return data

    def save(self) -> TrainingSession:
        """Create the session. Raises InvalidSetting for a plan that could not be walked."""
        data, answers = self.cleaned_data, self.chosen_answers()
        by_value = data["goal_by"] == "value"
        hits, minutes = data["wanted_hits"], data["minutes"]
        kind, _between, name = data["source"].partition(" ")
        return create_session(
            SessionRequest(
                patient=self.patient,
                valence=data["valence"],
                measure=data["measure"],
                goal=GoalRule(
                    value=data["goal_value"] if by_value else None,
                    percent_of_baseline=None if by_value else data["goal_percent"],
                    asks=answers["goal_asks"],
                ),
                protocol=data["protocol"],
                trained_side=Side(data["trained_side"]),
                target=Target(
                    hit_rate=hits / 100 if hits else None,
                    duration_s=minutes * 60 if minutes else None,
                ),
                cue=cue_from_choices(
                    data["robot_above"], data["robot_below"], data["valence"], self.patient
                ),
                robot_intensity=ROBOT_LEVELS[data["robot"]],
                activation_threshold=answers["robot_threshold"] / 100,
                cue_timing=read_cue_timing(answers),
                schedule=read_schedule(answers),
                adaptation=read_adaptation(answers),
                station=data["station"],
                created_by=self.by,
                source=dict(source_choices()).get(data["source"], ""),
                simulated=kind == "synthetic",
                source_args=build_source_args(kind, name, self.patient),
                walking=self.chosen_walking(),
            )
        )

    def create(self) -> TrainingSession | None:
        """Create the session; return None, with the reason in ``errors``, where it cannot."""
        if not self.is_valid():
            return None
        try:
            return self.save()
        except StationTaken as problem:  # since the form was checked
            self.taken_by = problem.session
            self.add_error("station", format_refusal(problem))
        except InvalidSetting as problem:
            self.add_error(None, format_refusal(problem))
        return None
