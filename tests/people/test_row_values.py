"""A form saves what it changed: what others change of the row at that moment stays."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from django.db.models import Model
from django.db.models.signals import pre_save
from django.urls import reverse

from rehab.people.roles import Role
from rehab.people.sign_in.tokens import ApiToken
from rehab.stations.models import Device, Station
from tests.support.world import NOW, World

pytestmark = pytest.mark.django_db

Change = dict[str, Any]


@contextmanager
def changed_meanwhile(row: Model, change: Change) -> Iterator[None]:
    """Change a stored row between the reading of it by a page and the saving."""

    def meddle(instance: Model, **_: Any) -> None:
        type(row).everywhere.filter(pk=instance.pk).update(**change)  # type: ignore[attr-defined]

    pre_save.connect(meddle, sender=type(row))
    yield
    assert pre_save.disconnect(meddle, sender=type(row))


def admin_form(row: Model, **fields: Any) -> Callable[[Any], Any]:
    url = reverse(f"admin:rehab_{row._meta.model_name}_change", args=[row.pk])
    return lambda client: client.post(url, fields)


def renamed(world: World, page: str) -> tuple[Any, Callable[[Any], Any], str, Change]:
    """Return a row, what gives it another name on a page, the name's field, and a change of it."""
    device, station = world.rows[Device], world.rows[Station]
    token, pt = world.rows[ApiToken], world.people[Role.PT]
    inline = {"devices-TOTAL_FORMS": 0, "devices-INITIAL_FORMS": 0}
    at = {"station": station.pk, "kind": device.kind}
    stations_page = reverse("edit-station", args=[station.pk])
    rotated = {"token_hash": "rotated", "rotated_at": NOW}
    role = {"role": "pt", "username": pt.username, "is_active": "on"}
    pages: dict[str, tuple[Any, Callable[[Any], Any], str, Change]] = {
        "a device's token": (device, admin_form(device, name="New", **at), "name", rotated),
        "a token": (token, admin_form(token, name="New"), "name", {"revoked_at": NOW}),
        "an account": (
            *(pt, admin_form(pt, first_name="New", **role), "first_name"),
            {"password": "new", "sign_in_generation": 7},
        ),
        "a station in the admin": (
            *(station, admin_form(station, name="New", **inline), "name"),
            {"robot_stopped": True},
        ),
        "a station on its page": (
            *(station, lambda client: client.post(stations_page, {"name": "New"}), "name"),
            {"robot_stopped": True, "pin_hash": "x"},
        ),
    }
    return pages[page]


@pytest.mark.parametrize(
    "page",
    [
        *("a device's token", "a token", "an account"),
        *("a station in the admin", "a station on its page"),
    ],
)
def test_a_new_name_changes_nothing_else_of_the_row(world, page):
    row, rename, field, change = renamed(world, page)
    lead = world.lead
    with changed_meanwhile(row, change):
        assert rename(lead).status_code == 302
    stored = type(row).everywhere.filter(pk=row.pk).values(field, *change).get()
    assert stored == {field: "New"} | change
