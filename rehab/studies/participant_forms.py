"""The forms of participants: enrolling a patient, starting a visit's session."""

from __future__ import annotations

from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.utils.text import capfirst
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Patient, User
from rehab.people.web.refusals import format_refusal
from rehab.sessions.formatting import format_source
from rehab.sessions.services import check_station_is_free
from rehab.sessions.setup.option import Group, OptionForm
from rehab.sessions.setup.options import build_parts, options_of
from rehab.sessions.setup.sources import build_source_args, source_choices
from rehab.stations.models import Station
from rehab.studies.agreements import StudyConsent
from rehab.studies.models import Study
from rehab.studies.visits import Place
from rehab.training.measures import InvalidSetting


class EnrollmentForm(forms.Form):
    """Who is assessed for a study: the answer to each criterion, the level of each factor."""

    patient: forms.ModelChoiceField[Patient] = forms.ModelChoiceField(queryset=None)
    takes_part = forms.TypedChoiceField(
        label=_("Takes part"),
        choices=[("yes", _("yes")), ("no", _("no, declines"))],
        coerce=lambda answer: answer == "yes",
        initial="yes",
        widget=forms.RadioSelect,
    )
    consent_version = forms.CharField(
        label=_("Consent to this study: version of the text that was signed"),
        max_length=40,
        required=False,
        help_text=_("As it is printed on it, such as 1.2."),
    )
    consented_on = forms.DateField(
        label=_("Signed on"),
        required=False,
        widget=forms.DateInput(attrs={"type": "date"}, format="%Y-%m-%d"),
    )
    keep_data = forms.TypedChoiceField(
        label=_("If the patient leaves the study, its sessions"),
        choices=[("yes", _("stay in its results")), ("no", _("are left out of its results"))],
        coerce=lambda answer: answer == "yes",
        widget=forms.RadioSelect,
    )

    def __init__(self, *args: Any, study: Study, by: User, **options: Any) -> None:
        super().__init__(*args, **options)
        self.study = study
        fields: dict[str, Any] = self.fields
        fields["patient"].queryset = Patient.objects.visible_to(by).filter(
            ended_at=None, erased_at=None
        )
        fields["patient"].label = capfirst(gettext("patient"))
        for number, criterion in enumerate(study.inclusion_criteria + study.exclusion_criteria):
            fields[f"criterion_{number}"] = forms.ChoiceField(
                label=criterion,
                choices=[("yes", gettext("yes")), ("no", gettext("no"))],
                widget=forms.RadioSelect,
            )
        for number, (name, levels) in enumerate(study.factors):
            fields[f"level_{number}"] = forms.ChoiceField(
                label=name, choices=[(level, level) for level in levels], widget=forms.RadioSelect
            )

    @property
    def consent(self) -> StudyConsent | None:
        """The consent to the study; None where version or day is missing."""
        version, day = (self.cleaned_data[name] for name in ("consent_version", "consented_on"))
        return StudyConsent(version, day) if version and day else None

    @property
    def met(self) -> list[str]:
        """The criteria that are met: those of inclusion by a yes, those of exclusion by a no."""
        included = len(self.study.inclusion_criteria)
        return [
            criterion
            for number, criterion in enumerate(self.study.criteria)
            if self.cleaned_data[f"criterion_{number}"] == ("yes" if number < included else "no")
        ]

    @property
    def levels(self) -> tuple[str, ...]:
        """The chosen level of each factor."""
        return tuple(self.cleaned_data[f"level_{n}"] for n in range(len(self.study.factors)))


class PlaceForm(OptionForm):
    """Where and how a visit's session is walked, and where its steps come from."""

    station: forms.ModelChoiceField[Station] = forms.ModelChoiceField(
        queryset=None, empty_label=None
    )
    source = forms.ChoiceField()

    def __init__(self, *args: Any, patient: Patient, by: User, **options: Any) -> None:
        super().__init__(*args, options=options_of(Group.WALKING), **options)
        self.patient = patient
        fields: dict[str, Any] = self.fields
        fields["station"].queryset = Station.objects.visible_to(by)
        fields["station"].label = capfirst(gettext("station"))
        fields["source"].label = capfirst(gettext("source"))
        fields["source"].choices = [
            (name, format_source(label)) for name, label in source_choices()
        ]

    def clean_station(self) -> Station:
        """Return the station. Refuses one with an open session."""
        station: Station = self.cleaned_data["station"]
        try:
            check_station_is_free(station)
        except InvalidSetting as problem:
            raise ValidationError(format_refusal(problem)) from problem
        return station

    @property
    def place(self) -> Place:
        """The chosen place."""
        data, parts = self.cleaned_data, build_parts(self.chosen())
        kind, _between, name = data["source"].partition(" ")
        return Place(
            station=data["station"],
            source=dict(source_choices())[data["source"]],
            source_args=tuple(build_source_args(kind, name, self.patient)),
            walking=parts["walking"],
            heart_rate_limit=parts["heart_rate_limit"],
        )
