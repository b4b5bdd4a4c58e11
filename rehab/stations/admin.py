"""Admin of stations and the devices that dial in from them."""

from __future__ import annotations

from typing import Any

from django.contrib import admin, messages
from django.contrib.admin import RelatedOnlyFieldListFilter
from django.db.models import QuerySet
from django.http import HttpRequest
from django.utils import timezone

from rehab.people.admin_base import ScopedAdmin
from rehab.stations.models import Device, Station


@admin.register(Station)
class StationAdmin(ScopedAdmin):
    """Stations of the clinic."""

    list_display = ("name",)
    search_fields = ("name",)


@admin.register(Device)
class DeviceAdmin(ScopedAdmin):
    """Devices of the clinic. A token is shown once, when it is made."""

    list_display = ("name", "kind", "station", "created_at", "last_seen_at", "revoked_at")
    list_filter = ("kind", ("station", RelatedOnlyFieldListFilter))
    readonly_fields = ("created_at", "last_seen_at", "revoked_at")
    fields = ("station", "kind", "name", "created_at", "last_seen_at", "revoked_at")
    actions = ("renew_tokens", "revoke_tokens")

    def save_model(self, request: HttpRequest, obj: Device, form: Any, change: bool) -> None:
        """Save the device; a new one gets its token, shown this one time."""
        token = None if change else obj.new_token()
        super().save_model(request, obj, form, change)
        if token:
            self._show(request, obj, token)

    @admin.action(description="Give new tokens (old ones stop at once)", permissions=["change"])
    def renew_tokens(self, request: HttpRequest, devices: QuerySet[Device]) -> None:
        """Replace the tokens of the chosen devices."""
        for device in devices:
            token = device.new_token()
            device.revoked_at = None
            device.save()
            self._show(request, device, token)

    @admin.action(description="Revoke tokens", permissions=["change"])
    def revoke_tokens(self, request: HttpRequest, devices: QuerySet[Device]) -> None:
        """Close the door to the chosen devices."""
        count = devices.filter(revoked_at__isnull=True).update(revoked_at=timezone.now())
        messages.success(request, f"{count} token(s) revoked.")

    def _show(self, request: HttpRequest, device: Device, token: str) -> None:
        messages.warning(request, f"Token of {device.name}, shown this one time only: {token}")
