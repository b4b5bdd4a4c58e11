"""Admin of stations and the devices that connect from them."""

from __future__ import annotations

from typing import Any

from django.contrib import admin
from django.contrib.admin import RelatedOnlyFieldListFilter
from django.db.models import F, Prefetch, QuerySet
from django.db.models.functions import Lower, TruncHour
from django.http import HttpRequest
from django.urls import reverse
from django.utils import timezone
from django.utils.html import format_html_join
from django.utils.safestring import mark_safe
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.web.admin_base import ScopedAdmin, ScopedOptions
from rehab.people.web.row_forms import ClinicForm
from rehab.people.web.token_admin import TokenAdmin
from rehab.stations.device_trust import with_trust
from rehab.stations.forms import PinForm
from rehab.stations.models import Device, Station
from rehab.stations.presence import format_badge, format_device_state, format_device_states


class DeviceInline(ScopedOptions, admin.TabularInline):
    """A station's devices on its page; each has a page of its own, with its token."""

    model = Device
    fields = readonly_fields = ("device", "kind", "state")
    ordering = ("kind", "name")
    extra = 0
    can_delete = False

    def has_add_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Return False: a new device's own page shows its token."""
        return False

    def has_change_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Return False: devices are changed on their own page."""
        return False

    @admin.display(description=_("device"))
    def device(self, device: Device) -> str:
        """Return a link to the device."""
        url = reverse("admin:rehab_device_change", args=[device.pk])
        return format_html_join("", '<a href="{}">{}</a>', [(url, device.name)])

    @admin.display(description=_("state"))
    def state(self, device: Device) -> str:
        """Return when the device last connected."""
        now = timezone.now()
        return format_badge(device, format_device_state(device, now), now)


class StationAdminForm(PinForm, ClinicForm):
    """A station with its PIN."""


@admin.register(Station)
class StationAdmin(ScopedAdmin):
    """Stations of the clinic, each with its devices."""

    form = StationAdminForm
    fields = ("name", "pin", "no_pin")
    list_display = ("name", "tablets", "sources", "robots", "has_pin")
    actions = None  # few rows, each with a page of its own
    inlines = (DeviceInline,)

    def get_omitted_fields(self, request: HttpRequest, obj: Any) -> set[str]:
        """Return as well the box that removes a PIN where none is set."""
        unset = set() if obj and obj.pin_hash else {"no_pin"}
        return super().get_omitted_fields(request, obj) | unset

    def get_queryset(self, request: HttpRequest) -> QuerySet[Station]:
        """Return the visible stations with their devices."""
        devices = with_trust(Device.objects.visible_to(request.user)).order_by("name")
        return super().get_queryset(request).prefetch_related(Prefetch("devices", devices))

    def get_row_links(self, request: HttpRequest, row: Any) -> list[tuple[str, Any]]:
        """Return links to pair a tablet, to check a recording and to add a device."""
        links = [
            (reverse("pair"), _("Pair a tablet")),
            (reverse("check-recording"), _("Check a recording")),
        ]
        if self.has_change_permission(request, row):
            url = reverse("admin:rehab_device_add")
            links.append((f"{url}?station={row.pk}", _("Add a sensor or robot")))
        return links

    @admin.display(description=_("tablet"))
    def tablets(self, station: Station) -> str:
        """Return the tablets with their states."""
        return self._format_devices(station, Device.Kind.TABLET)

    @admin.display(description=_("sensor"))
    def sources(self, station: Station) -> str:
        """Return the sources with their states."""
        return self._format_devices(station, Device.Kind.SOURCE)

    @admin.display(description=_("robot"))
    def robots(self, station: Station) -> str:
        """Return the robots with their states."""
        return self._format_devices(station, Device.Kind.ROBOT)

    def _format_devices(self, station: Station, kind: Device.Kind) -> str:
        now = timezone.now()
        devices = [device for device in station.devices.all() if device.kind == kind]
        states = format_device_states(devices, now)
        found = [(device.name, format_badge(device, state, now)) for device, state in states]
        return format_html_join(mark_safe("<br>"), "{} {}", found)

    @admin.display(description=_("Leaving the patient’s page"))
    def has_pin(self, station: Station) -> str:
        """Return whether leaving the patient's page asks for a PIN."""
        return gettext("with a PIN") if station.pin_hash else gettext("without a PIN")


@admin.register(Device)
class DeviceAdmin(TokenAdmin):
    """Devices of the clinic. A token is shown once, when it is issued."""

    list_display = ("name", "kind", "station", "state")
    list_filter = (
        "kind",
        ("station", RelatedOnlyFieldListFilter),
        ("revoked_at", admin.EmptyFieldListFilter),
        ("last_seen_at", admin.EmptyFieldListFilter),
    )
    list_select_related = ("station",)
    search_fields = ("name", "station__name")
    # Those that were away longest come first, revoked ones last.
    ordering = (
        F("revoked_at").asc(nulls_first=True),
        TruncHour("last_seen_at").asc(nulls_first=True),
        Lower("name"),  # an expression, so that no column is marked as the sorted one
    )
    approval = ("approver", "approved_at", "network", "browser")
    fields = (
        *("station", "kind", "name", "state", "created_at", "last_seen_at", "revoked_at"),
        *approval,
    )
    readonly_fields = ("state", *TokenAdmin.readonly_fields, *approval)
    radio_fields = {"kind": admin.HORIZONTAL}
    about_actions = _(
        "A new key: when the device was lost, or somebody else may know its key; then enter the "
        "new one on it. Disconnect: when it is not used for a while."
    )
    row_words = TokenAdmin.row_words | {
        "revoke_tokens": _("Disconnect this device until it has a new key")
    }

    def get_row_actions(self, row: Any) -> tuple[str, ...]:
        """Return the row's actions; a built-in device gets its keys from the server."""
        return () if row.builtin else super().get_row_actions(row)

    def get_readonly_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return as well the kind of a device that exists: it stays what it is."""
        fixed = ("kind",) if obj else ()
        return (*fixed, *super().get_readonly_fields(request, obj))

    def get_queryset(self, request: HttpRequest) -> QuerySet[Device]:
        """Return the visible devices, with what their state follows from."""
        return with_trust(super().get_queryset(request))

    @admin.display(description=_("state"), ordering="last_seen_at")
    def state(self, device: Device) -> str:
        """Return that the device is revoked, or when it last connected."""
        if not device.pk:
            return gettext("Its token is shown once you save it.")
        now = timezone.now()
        return format_badge(device, format_device_state(device, now), now)
