"""Admin of stations and the devices that dial in from them."""

from __future__ import annotations

from typing import Any

from django import forms
from django.contrib import admin
from django.contrib.admin import RelatedOnlyFieldListFilter
from django.core.exceptions import ValidationError
from django.db.models import Prefetch, QuerySet
from django.http import HttpRequest
from django.urls import reverse
from django.utils import timezone
from django.utils.html import format_html_join
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.web.admin_base import ClinicForm, ScopedAdmin, ScopedOptions, TokenAdmin
from rehab.stations.models import Device, Station
from rehab.stations.pins import LONGEST, set_pin
from rehab.stations.presence import say_state


class DeviceRows(ScopedOptions, admin.TabularInline):
    """A station's devices on its page; each has a page of its own, with its token."""

    model = Device
    fields = readonly_fields = ("device", "kind", "state")
    ordering = ("kind", "name")
    extra = 0
    can_delete = False

    def has_add_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Devices are added on a page of their own, which shows the token."""
        return False

    def has_change_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Devices are changed on their own page."""
        return False

    @admin.display(description=_("device"))
    def device(self, device: Device) -> str:
        """Lead to the device."""
        url = reverse("admin:rehab_device_change", args=[device.pk])
        return format_html_join("", '<a href="{}">{}</a>', [(url, device.name)])

    @admin.display(description=_("state"))
    def state(self, device: Device) -> str:
        """Say when it was seen last."""
        return say_state(device, timezone.now())


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
    """Stations of the clinic, each with what belongs there."""

    form = StationForm
    fields = ("name", "pin", "no_pin")
    list_display = ("name", "tablets", "sources", "robots", "has_pin")
    search_fields = ("name", "devices__name")
    inlines = (DeviceRows,)

    def get_queryset(self, request: HttpRequest) -> QuerySet[Station]:
        """Give the visible stations with their devices."""
        devices = Device.objects.visible_to(request.user).order_by("name")
        return super().get_queryset(request).prefetch_related(Prefetch("devices", devices))

    def get_row_links(self, request: HttpRequest, row: Any) -> list[tuple[str, Any]]:
        """Lead to where a tablet is let in, and a device added."""
        links = [(reverse("pair"), _("Let a tablet in"))]
        if self.has_change_permission(request, row):
            url = reverse("admin:rehab_device_add")
            links.append((f"{url}?station={row.pk}", _("Add a source or robot")))
        return links

    @admin.display(description=_("tablet"))
    def tablets(self, station: Station) -> str:
        """Say which tablet is here."""
        return self._tell(station, Device.Kind.TABLET)

    @admin.display(description=_("source of steps"))
    def sources(self, station: Station) -> str:
        """Say which source is here."""
        return self._tell(station, Device.Kind.SOURCE)

    @admin.display(description=_("robot"))
    def robots(self, station: Station) -> str:
        """Say which robot is here."""
        return self._tell(station, Device.Kind.ROBOT)

    def _tell(self, station: Station, kind: Device.Kind) -> str:
        now = timezone.now()
        found = [
            (device.name, say_state(device, now))
            for device in station.devices.all()
            if device.kind == kind
        ]
        return format_html_join(", ", "{}: {}", found) or gettext("none")

    @admin.display(description=_("PIN to leave"), boolean=True)
    def has_pin(self, station: Station) -> bool:
        """Whether leaving the patient's page asks for a PIN."""
        return bool(station.pin_hash)


@admin.register(Device)
class DeviceAdmin(TokenAdmin):
    """Devices of the clinic. A token is shown once, when it is made."""

    list_display = ("name", "kind", "station", "state", "last_seen_at", "created_at")
    list_filter = (
        "kind",
        ("station", RelatedOnlyFieldListFilter),
        ("revoked_at", admin.EmptyFieldListFilter),
        ("last_seen_at", admin.EmptyFieldListFilter),
    )
    list_select_related = ("station",)
    search_fields = ("name", "station__name")
    fields = ("station", "kind", "name", "state", "created_at", "last_seen_at", "revoked_at")
    readonly_fields = ("state", *TokenAdmin.readonly_fields)
    radio_fields = {"kind": admin.HORIZONTAL}

    @admin.display(description=_("state"), ordering="last_seen_at")
    def state(self, device: Device) -> str:
        """Say whether it may dial in, and when it last did."""
        if not device.pk:
            return gettext("Its token is shown once you save it.")
        return say_state(device, timezone.now())
