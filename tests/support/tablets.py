"""Tablets and phones to test with: a person lets them in."""

from __future__ import annotations

from typing import Any

from django.test import Client
from django.utils import timezone

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.stations.models import Device, Station

PAIR = "/tablets/pair/"


def shown_code(tablet: Client) -> str:
    """Return the code that a browser at /tablet/ shows."""
    code: str = tablet.get("/tablet/").context["code"]
    return code


def enter_code(person: Client, code: str, station: Station) -> Any:
    """Send the code that a person has typed; return the page that describes the tablet."""
    return person.post(PAIR, {"code": code, "station": station.pk})


def let_in(person: Client, code: str, station: Station) -> Any:
    """Let in the tablet that shows a code, in both steps; return the last answer."""
    enter_code(person, code, station)
    return person.post(PAIR, {"code": code, "station": station.pk, "compared": "yes"})


def pair_tablet(person: Client, station: Station, tablet: Client | None = None) -> Client:
    """Return a browser that a person has let in as a station's tablet."""
    tablet = tablet or Client()
    let_in(person, shown_code(tablet), station)
    tablet.get("/tablet/state/")
    return tablet


def pair_phone(person: Client, station: Station) -> str:
    """Return the token of a phone that a person pairs as a sensor; empty where it is refused."""
    worn = {"station": station.pk, "side": "left"}
    page = person.post("/phones/pair/", worn).content.decode()
    return page.partition("token=")[2].partition("&")[0]


def is_paired(tablet: Client) -> bool:
    """Return whether a browser is a tablet of a station."""
    return bool(tablet.get("/tablet/state/").json()["paired"])


def approved(station: Station, name: str = "T", **fields: Any) -> tuple[Device, str]:
    """Return a tablet that somebody of the station's clinic has let in, and its token."""
    carers = User.everywhere.filter(clinic=station.clinic_id, role__in=(Role.LEAD, Role.PT))
    carer = carers.order_by("role").first() or User.everywhere.create_user(
        f"carer-{station.clinic_id}", role=Role.PT, clinic=station.clinic
    )
    let_in = {"approver": carer, "approved_at": timezone.now()}
    tablet = Device(
        **{"clinic": station.clinic, "station": station, "kind": "tablet", "name": name}
        | ({} if fields.get("kind", "tablet") != "tablet" else let_in)
        | fields
    )
    token = tablet.new_token()
    tablet.save()
    return tablet, token
