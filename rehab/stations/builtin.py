"""Devices that the server itself runs: a simulated patient, a recording, a simulated robot."""

from __future__ import annotations

from rehab.people.models import Clinic
from rehab.stations.models import Device, Station

FIRST_STATION = "Station 1"


def first_station(clinic: Clinic) -> Station:
    """Return a clinic's first station; create it on first use."""
    stations = Station.everywhere.filter(clinic=clinic).order_by("pk")
    return stations.first() or Station.everywhere.create(clinic=clinic, name=FIRST_STATION)


def issue_builtin_token(station: Station, kind: Device.Kind) -> str:
    """Return a new token of the station's built-in device; the one before stops working."""
    device = Device.everywhere.filter(station=station, kind=kind, builtin=True).first()
    if device is None:
        device = Device(
            clinic_id=station.clinic_id, station=station, kind=kind, name="Built in", builtin=True
        )
    token = device.new_token()
    device.revoked_at = None
    device.save()
    return token
