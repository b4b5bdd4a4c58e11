"""The PIN to leave: kept as a hash, tried a few times a screen, never in the way of a session."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.test import Client
from django.utils import timezone

from rehab.stations.models import Device, PinAttempts, Station
from rehab.stations.pins import FREE_ATTEMPTS, LONGEST_LOCKOUT, PinRefused, check_pin, set_pin
from rehab.stations.tablets import COOKIE
from tests.support.world import NOW, World, build_world

pytestmark = pytest.mark.django_db
SCREEN = "tablet 1"


@pytest.fixture
def station(world: World) -> Station:
    made = Station(clinic=world.clinic, name="Bay 4")
    set_pin(made, "4711")
    made.save()
    return made


@pytest.fixture
def tablet(world: World, station: Station) -> tuple[Client, Device]:
    return world.add_tablet(station)


def wait_for(station: Station, pin: str, now, who: str = SCREEN) -> int:
    with pytest.raises(PinRefused) as refused:
        check_pin(station, who, pin, now)
    return refused.value.wait_s


def test_only_a_hash_is_kept(station):
    assert "4711" not in station.pin_hash
    check_pin(station, SCREEN, "4711", NOW)
    set_pin(station, "")
    check_pin(station, SCREEN, "", NOW)  # without one, leaving is free


@pytest.mark.parametrize("pin", ["123", "123456789", "12a4", "١٢٣٤", "12 4", "-123"])
def test_a_pin_is_four_to_eight_digits(station, pin):
    with pytest.raises(ValueError, match="four to eight digits"):
        set_pin(station, pin)


def test_wrong_pins_wait_longer_each_time(station):
    now, waits = NOW, []
    for _ in range(FREE_ATTEMPTS + 12):
        waits.append(wait_for(station, "0000", now))
        now += timedelta(seconds=waits[-1])
    assert waits[: FREE_ATTEMPTS + 3] == [0, 0, 30, 60, 120, 240]
    assert waits == sorted(waits)
    assert waits[-1] == LONGEST_LOCKOUT.total_seconds()
    assert wait_for(station, "4711", now - timedelta(seconds=5)) == 5  # the right one waits too
    check_pin(station, "tablet 2", "4711", NOW)  # another screen does not
    check_pin(station, SCREEN, "4711", now)
    assert wait_for(station, "0000", now) == 0  # and all is forgotten


def test_a_try_is_counted_before_it_is_looked_at(station, monkeypatch):
    """Many at once are one: whoever comes between finds the count gone up."""
    seen = []

    def slow(pin: str, kept: str) -> bool:
        seen.append(PinAttempts.everywhere.get(station=station).failures)
        return False

    monkeypatch.setattr("rehab.stations.pins.check_password", slow)
    for _ in range(FREE_ATTEMPTS):
        wait_for(station, "0000", NOW)
    assert seen == [1, 2, 3]
    assert wait_for(station, "0001", NOW) > 0
    assert len(seen) == FREE_ATTEMPTS  # not even looked at


def test_a_tablet_leaves_with_the_pin_and_stays_paired(tablet, station):
    client, device = tablet
    form = {"station": station.pk, "pin": "0000"}
    answer = client.post("/tablets/leave/", form)
    assert answer.status_code == 403
    assert answer.json() == {"message": "This is not the PIN.", "wait_s": 0}
    assert client.post("/tablets/leave/", form | {"pin": "4711"}).json() == {"go": "/start/"}
    device.refresh_from_db()
    assert not device.is_revoked


def test_a_tablet_is_given_back_with_the_pin_alone(tablet, station):
    client, device = tablet
    form = {"station": station.pk, "unpair": "yes"}
    assert client.post("/tablets/leave/", form | {"pin": "1"}).status_code == 403
    device.refresh_from_db()
    assert not device.is_revoked
    answer = client.post("/tablets/leave/", form | {"pin": "4711"})
    assert answer.json() == {"go": "/tablet/"}
    assert not answer.cookies[COOKIE].value
    device.refresh_from_db()
    assert device.is_revoked
    assert "code" in client.get("/tablet/").context


def test_wrong_pins_stop_no_session(world, tablet, station):
    client, _ = tablet
    type(world.session).everywhere.filter(pk=world.session.pk).update(
        station=station, state="running"
    )
    for _ in range(FREE_ATTEMPTS + 2):
        client.post("/tablets/leave/", {"station": station.pk, "pin": "0000"})
    page = client.get(f"/sessions/{world.session.pk}/")
    assert page.status_code == 200
    assert 'data-change="pause"' in page.content.decode()
    world.session.refresh_from_db()
    assert world.session.state == "running"


@pytest.mark.parametrize("number", ["", "0", "x", "99999999999999999999"])
def test_an_unknown_station_opens_nothing(tablet, number):
    client, _ = tablet
    assert client.post("/tablets/leave/", {"station": number}).status_code == 404


def test_a_station_of_another_clinic_opens_nothing(tablet):
    birch = build_world("birch")
    client, _ = tablet
    answer = client.post("/tablets/leave/", {"station": birch.rows[Station].pk})
    assert answer.status_code == 404
    pt = birch.pt
    assert pt.post("/tablets/leave/", {"station": tablet[1].station_id}).status_code == 404
    stranger = Client().post("/tablets/leave/", {"station": tablet[1].station_id})
    assert stranger.headers["Location"].startswith("/sign-in/")


def test_a_lead_sets_and_removes_the_pin_in_the_admin(world, station):
    lead = world.lead
    url, kept = f"/admin/rehab/station/{station.pk}/change/", station.pin_hash
    given = {"name": "Bay 5", "devices-TOTAL_FORMS": 0, "devices-INITIAL_FORMS": 0}
    page = lead.get(url).content.decode()
    assert kept not in page
    assert "A PIN is set." in page
    assert "four to eight digits" in lead.post(url, given | {"pin": "12"}).content.decode()
    lead.post(url, given | {"pin": ""})
    station.refresh_from_db()
    assert (station.name, station.pin_hash) == ("Bay 5", kept)
    lead.post(url, given | {"pin": "246810"})
    station.refresh_from_db()
    check_pin(station, SCREEN, "246810", timezone.now())
    lead.post(url, given | {"no_pin": "on"})
    station.refresh_from_db()
    assert station.pin_hash == ""
    page = lead.get(url).content.decode()
    assert "No PIN is set" in page
    assert 'name="no_pin"' not in page
