"""Devices that the server itself runs: a simulated patient, a recording, a simulated robot."""

from __future__ import annotations

from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import override

from rehab.people.models import Clinic, User
from rehab.stations.models import Device, Station


def first_station(clinic: Clinic) -> Station:
    """Return a clinic's first station; create it on first use, named in the clinic's language."""
    found = Station.everywhere.filter(clinic=clinic).order_by("pk").first()
    if found is not None:
        return found
    with override(clinic.language):
        return Station.everywhere.create(clinic=clinic, name=_("Station 1"))


def builtin_device(station: Station, kind: Device.Kind, by: User | None = None) -> Device:
    """Return the station's built-in device, not saved; who gets its token answers for it."""
    device = Device.everywhere.filter(station=station, kind=kind, builtin=True).first()
    if device is None:
        with override(station.clinic.language):
            name = _("Built-in robot") if kind == Device.Kind.ROBOT else _("Built-in sensor")
        device = Device(
            clinic_id=station.clinic_id, station=station, kind=kind, name=name, builtin=True
        )
    device.revoked_at, device.approver = None, by
    device.note_issuer(by, timezone.now())
    return device


def issue_builtin_token(station: Station, kind: Device.Kind, by: User | None = None) -> str:
    """Return a new token of the station's built-in device; the one before stops working.

    A person who gets it (``by``) answers for it, and it ends after a day in the clinic.
    """
    device = builtin_device(station, kind, by)
    token = device.new_token()
    device.save()
    return token
