"""Forms of stations and their devices."""

from __future__ import annotations

from typing import Any, ClassVar

from django import forms
from django.core.exceptions import ValidationError
from django.utils.translation import gettext_lazy as _

from rehab.people.access import clinic_of
from rehab.people.models import User
from rehab.people.row_values import read_values, save_changes
from rehab.stations.models import Device, Station
from rehab.stations.pins import MAX_LENGTH, set_pin


class PinForm(forms.ModelForm):
    """A station with its PIN, which is never shown."""

    instance: Station

    pin = forms.CharField(
        label=_("PIN to leave the patient’s page"),
        required=False,
        max_length=MAX_LENGTH,
        widget=forms.PasswordInput(attrs={"inputmode": "numeric", "autocomplete": "new-password"}),
    )
    no_pin = forms.BooleanField(
        label=_("Remove the PIN (leaving then takes one extra tap)"), required=False
    )

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._before = read_values(self.instance)
        if self.instance.pin_hash:
            now = _("A PIN is set. Leave this empty to keep it, or give another of 4 to 8 digits.")
        else:
            del self.fields["no_pin"]
            now = _("No PIN is set: leaving takes one extra tap. To set one, give 4 to 8 digits.")
        self.fields["pin"].help_text = now

    def save(self, commit: bool = True) -> Station:
        """Save a new station; of another one what was changed: its robot may be stopped now."""
        station = self.instance
        if self._before["id"] is None or not commit:
            super().save(commit)
        else:
            save_changes(station, self._before)
        return station

    def clean(self) -> dict[str, Any] | None:
        """Set the PIN; only its hash is stored."""
        data = super().clean()
        pin = self.cleaned_data.get("pin", "")
        try:
            if pin or self.cleaned_data.get("no_pin"):
                set_pin(self.instance, pin)
        except ValueError as problem:
            raise ValidationError({"pin": str(problem)}) from problem
        return data


class StationForm(PinForm):
    """A station of a clinic, new or to be edited."""

    class Meta:
        model = Station
        fields: ClassVar = ["name"]

    def __init__(self, *args: Any, by: User, **options: Any) -> None:
        super().__init__(*args, **options)
        self.instance.clinic = clinic_of(by)
        self._by = by

    def clean_name(self) -> str:
        """Return the name. Refuses one that another station of the clinic has."""
        name = str(self.cleaned_data["name"])
        others = Station.objects.visible_to(self._by).filter(name=name)
        if others.exclude(pk=self.instance.pk).exists():
            raise ValidationError(_("Another station has this name. Choose another one."))
        return name


class DeviceForm(forms.ModelForm):
    """A new source or robot of a station. Tablets are paired."""

    KINDS: ClassVar = [Device.Kind.SOURCE, Device.Kind.ROBOT]

    class Meta:
        model = Device
        fields: ClassVar = ["kind", "name"]

    kind = forms.ChoiceField(
        label=_("Kind"),
        choices=[(kind.value, kind.label) for kind in KINDS],
        initial=Device.Kind.SOURCE.value,
        widget=forms.RadioSelect,
    )

    def __init__(self, *args: Any, station: Station, **options: Any) -> None:
        super().__init__(*args, **options)
        self.instance.station = station
        self.instance.clinic_id = station.clinic_id
        self.fields["name"].help_text = _("What you call it, such as “Treadmill sensor”.")

    def issue(self) -> str:
        """Store the device and return its token, which is shown once."""
        token: str = self.instance.new_token()
        self.save()
        return token
