"""The form that sets a session up."""

from __future__ import annotations

from typing import Any

from django import forms
from django.conf import settings
from django.core.exceptions import ValidationError
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from rehab.people.models import SIDES, Patient, User
from rehab.people.web.refusals import format_refusal
from rehab.sessions.forms.initial import usual_measure
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import (
    SessionRequest,
    StationTaken,
    check_station_is_free,
    create_session,
)
from rehab.sessions.setup.cue_gestures import cue_from_choices
from rehab.sessions.setup.option import OptionForm
from rehab.sessions.setup.options import OPTIONS, build_parts
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.sessions.setup.sensors import measurable
from rehab.sessions.setup.sources import LIVE, SIMULATED, build_source_args, source_choices
from rehab.sources.recording import RecordingError, read_recording
from rehab.sources.recording.source import holds_signals
from rehab.stations.models import Station
from rehab.training import measures as rules
from rehab.training.measures import A2, MEASURES, InvalidSetting
from rehab.training.steps import Side

ROW_FIELDS: dict[str, Any] = {
    "measure": MeasureDefinition,
    "protocol": Protocol,
    "station": Station,
}


class SessionForm(OptionForm):
    """The set-up of one patient's session. With its initial values it can be sent as it is.

    Attributes
    ----------
    taken_by
        The open session at the chosen station, which was refused for it.
    """

    measure: forms.ModelChoiceField[MeasureDefinition] = forms.ModelChoiceField(
        queryset=None, empty_label=None, required=False
    )
    protocol: forms.ModelChoiceField[Protocol] = forms.ModelChoiceField(
        queryset=None, empty_label=None, widget=forms.RadioSelect
    )
    station: forms.ModelChoiceField[Station] = forms.ModelChoiceField(
        queryset=None, empty_label=None, widget=forms.RadioSelect
    )
    trained_side = forms.ChoiceField(choices=SIDES, widget=forms.RadioSelect)

    def __init__(self, *args: Any, patient: Patient, by: User, **others: Any) -> None:
        super().__init__(*args, options=OPTIONS.values(), by=by, **others)
        self.patient, self.by = patient, by
        self.taken_by: TrainingSession | None = None
        fields: dict[str, Any] = self.fields
        for name, model in ROW_FIELDS.items():
            fields[name].queryset = model.objects.visible_to(by)
        slugs = self._measurable(self.chosen_station, self["source"].value())
        if slugs is not None:
            widget = fields["measure"].widget
            widget.choices = [one for one in widget.choices if one[0].instance.slug in slugs]

    @staticmethod
    def _measurable(station: Station | None, source: str) -> frozenset[str] | None:
        """Return the slugs of the measures that live sensors there have; None where any may be."""
        return measurable(station, timezone.now()) if source == LIVE else None

    @property
    def chosen_measure(self) -> rules.Measure:
        """The measure that the form shows, A2 where it names none that exists."""
        field: Any = self.fields["measure"]
        try:
            row: MeasureDefinition | None = field.clean(self["measure"].value())
        except ValidationError:
            row = None
        return A2 if row is None else row.to_rule()

    @property
    def chosen_station(self) -> Station | None:
        """The station that the form shows; None where it names none that exists."""
        field: Any = self.fields["station"]
        value = self["station"].value()
        return value if isinstance(value, Station) else field.queryset.filter(pk=value).first()

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
        slugs = self._measurable(data.get("station"), data.get("source", ""))
        if slugs is not None and measure.slug not in slugs:
            message = _("The sensors that are paired here do not measure this. Choose another.")
            self.add_error("measure", message)
        if measure.slug not in MEASURES and data.get("source", "").startswith(SIMULATED):
            message = _("Simulated patients do not walk this measure. Choose another source.")
            self.add_error("source", message)
        return data

    def save(self) -> TrainingSession:
        """Create the session. Raises InvalidSetting for a plan that could not be walked."""
        data, chosen = self.cleaned_data, self.chosen()
        kind, _between, name = data["source"].partition(" ")
        return create_session(
            SessionRequest(
                patient=self.patient,
                valence=data["valence"],
                measure=data["measure"],
                protocol=data["protocol"],
                trained_side=Side(data["trained_side"]),
                cue=cue_from_choices(
                    data["robot_above"], data["robot_below"], data["valence"], self.patient
                ),
                station=data["station"],
                created_by=self.by,
                source=dict(source_choices()).get(data["source"], ""),
                source_args=build_source_args(kind, name, self.patient),
                **build_parts(chosen),
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
