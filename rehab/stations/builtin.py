"""What the server itself runs at a station: a simulated patient, a recording, a simulated robot."""

from __future__ import annotations

from rehab.people.models import Clinic
from rehab.stations.models import Device, Station

FIRST_STATION = "Station 1"


def first_station(clinic: Clinic) -> Station:
    """Give a clinic's first station; made on first use."""
    stations = Station.everywhere.filter(clinic=clinic).order_by("pk")
    return stations.first() or Station.everywhere.create(clinic=clinic, name=FIRST_STATION)


def builtin_token(station: Station, kind: Device.Kind) -> str:
    """Give a fresh token for the station's built-in device of this kind; the one before is dead."""
    device = Device.everywhere.filter(station=station, kind=kind, builtin=True).first()
    if device is None:
        device = Device(
            clinic_id=station.clinic_id, station=station, kind=kind, name="Built in", builtin=True
        )
    token = device.new_token()
    device.revoked_at = None
    device.save()
    return token
