"""Admin of stations and the devices that dial in from them."""

from __future__ import annotations

from typing import Any

from django import forms
from django.contrib import admin
from django.contrib.admin import RelatedOnlyFieldListFilter
from django.core.exceptions import ValidationError
from django.utils.translation import gettext_lazy as _

from rehab.people.admin_base import ClinicForm, ScopedAdmin, TokenAdmin
from rehab.stations.models import Device, Station
from rehab.stations.pins import LONGEST, set_pin


class StationForm(ClinicForm):
    """A station with its PIN, which is written and never read."""

    pin = forms.CharField(
        label=_("New PIN to leave the patient’s page"),
        required=False,
        max_length=LONGEST,
        widget=forms.PasswordInput(attrs={"inputmode": "numeric", "autocomplete": "new-password"}),
        help_text=_(
            "Four to eight digits, asked for at this station’s tablet. Empty: stays as it is."
        ),
    )
    no_pin = forms.BooleanField(label=_("No PIN: leaving asks a plain question"), required=False)

    def clean(self) -> dict[str, Any] | None:
        """Take the PIN; only its hash is kept."""
        data = super().clean()
        pin = self.cleaned_data.get("pin", "")
        try:
            if pin or self.cleaned_data.get("no_pin"):
                set_pin(self.instance, pin)
        except ValueError as problem:
            raise ValidationError({"pin": str(problem)}) from problem
        return data


@admin.register(Station)
class StationAdmin(ScopedAdmin):
    """Stations of the clinic."""

    form = StationForm
    list_display = ("name", "has_pin")
    search_fields = ("name",)
    fields = ("name", "pin", "no_pin")

    @admin.display(description=_("PIN to leave"), boolean=True)
    def has_pin(self, station: Station) -> bool:
        """Whether leaving the patient's page asks for a PIN."""
        return bool(station.pin_hash)


@admin.register(Device)
class DeviceAdmin(TokenAdmin):
    """Devices of the clinic. A token is shown once, when it is made."""

    list_display = ("name", "kind", "station", "created_at", "last_seen_at", "revoked_at")
    list_filter = ("kind", ("station", RelatedOnlyFieldListFilter))
    fields = ("station", "kind", "name", "created_at", "last_seen_at", "revoked_at")
