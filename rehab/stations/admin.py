"""Admin of stations and the devices that dial in from them."""

from __future__ import annotations

from django.contrib import admin
from django.contrib.admin import RelatedOnlyFieldListFilter

from rehab.people.admin_base import ScopedAdmin, TokenAdmin
from rehab.stations.models import Device, Station


@admin.register(Station)
class StationAdmin(ScopedAdmin):
    """Stations of the clinic."""

    list_display = ("name",)
    search_fields = ("name",)


@admin.register(Device)
class DeviceAdmin(TokenAdmin):
    """Devices of the clinic. A token is shown once, when it is made."""

    list_display = ("name", "kind", "station", "created_at", "last_seen_at", "revoked_at")
    list_filter = ("kind", ("station", RelatedOnlyFieldListFilter))
    fields = ("station", "kind", "name", "created_at", "last_seen_at", "revoked_at")
