"""A tablet is trusted as far as the person who let it in, and no longer."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest
from django.core.cache import cache
from django.test import Client
from django.utils import timezone

from rehab.boards import views
from rehab.people.audit.audit_log import AuditEntry
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent, withdraw_consent
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.stations.models import Device, Station
from rehab.stations.tablets import COOKIE
from rehab.stations.tokens import find_device
from rehab.studies.blinding import Task, give_mark
from tests.support.studies import running_study
from tests.support.tablets import (
    PAIR,
    enter_code,
    is_paired,
    let_in,
    pair_tablet,
    shown_code,
)
from tests.support.world import NOW, World, signed_in

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]

CLINIC, HOME = "192.168.7.20", "203.0.113.9"  # addresses
FIREFOX = "Mozilla/5.0 (Android 14; Tablet; rv:139.0) Gecko/139.0 Firefox/139.0"


@pytest.fixture(autouse=True)
def fresh_cache():
    cache.clear()


@pytest.fixture
def station(world: World) -> Station:
    return world.add_station()


@pytest.fixture
def approver(world: World) -> User:
    """Return a therapist of whom no row of the world was made."""
    return User.everywhere.create_user("approver", role=Role.PT, clinic=world.clinic)


def set_networks(world: World, networks: str = "192.168.7.0/24") -> None:
    Clinic.everywhere.filter(pk=world.clinic.pk).update(networks=networks)


def open_session(world: World, station: Station) -> Any:
    """Return a session that is open at a station."""
    session = world.session
    type(session).everywhere.filter(pk=session.pk).update(station=station, state="ready")
    return session


def devices(station: Station) -> Any:
    return Device.everywhere.filter(station=station, kind="tablet")


# --- who may let a tablet in ----------------------------------------------------------------------


def test_a_blinded_assessor_lets_no_tablet_in(world, approver, station):
    give_mark(running_study(world), approver, Task.ASSESSOR, None, NOW)
    own = Client()
    page = let_in(signed_in(approver), shown_code(own), station).content.decode()
    assert "assessor" in page
    assert not devices(station).exists()
    assert not is_paired(own)
    assert AuditEntry.everywhere.filter(act="refused", by=approver).exists()


@pytest.mark.parametrize("tablets", ["127.0.0.1", "192.168.1.20", "192.168.1.31"])
def test_this_computer_is_in_its_own_network(world, station, monkeypatch, tablets):
    monkeypatch.setattr("rehab.stations.pages.pairing.network_address", lambda: "192.168.1.20")
    person = signed_in(world.people[Role.PT], REMOTE_ADDR="127.0.0.1")
    page = enter_code(person, shown_code(Client(REMOTE_ADDR=tablets)), station).content.decode()
    assert "another network" not in page
    away = shown_code(Client(REMOTE_ADDR="192.168.7.31"))
    assert "another network" in enter_code(person, away, station).content.decode()


def test_the_page_describes_the_tablet_and_lets_it_in_once_compared(world, station):
    person = signed_in(world.people[Role.PT], REMOTE_ADDR="198.51.100.4")
    tablet = Client(REMOTE_ADDR=HOME, HTTP_USER_AGENT=FIREFOX)
    code = shown_code(tablet)
    page = enter_code(person, code, station).content.decode()
    for said in (code, "Bay 4", "203.0.113.0/24", "198.51.100.0/24", "Firefox, Android"):
        assert said in page
    assert "another network" in page  # a warning: the clinic has named no networks
    assert not devices(station).exists()
    let_in(person, code, station)
    device = devices(station).get()
    assert device.approver == world.people[Role.PT]
    assert (device.network, device.browser) == ("203.0.113.0/24", "Firefox, Android")
    assert timezone.now() - device.approved_at < timedelta(minutes=1)
    entry = AuditEntry.everywhere.get(act="tablet_in")
    assert (entry.by, entry.address) == (world.people[Role.PT], "198.51.100.0/24")
    for said in ("Bay 4", "203.0.113.0/24"):
        assert said in entry.about
    listed = world.lead.get("/stations/").content.decode()
    for said in (str(device.approver), "203.0.113.0/24", "Firefox, Android", "never seen"):
        assert said in listed


def test_first_steps_compares_as_well(world, station):
    code, form = shown_code(Client()), {"station": station.pk}
    page = world.pt.post("/first-steps/?step=tablet", form | {"code": code})
    assert code in page.content.decode()
    assert not devices(station).exists()
    world.pt.post("/first-steps/?step=tablet", form | {"code": code, "compared": "yes"})
    assert devices(station).exists()


def test_a_tablet_that_was_seen_reaches_the_server(world, station, settings):
    asked, unreached = "/first-steps/?step=tablet", "only this computer can open GARRY"
    Device.everywhere.update(last_seen_at=None)
    pt, code = world.pt, shown_code(Client())
    pt.post(asked, {"station": station.pk, "code": code, "compared": "yes"})
    pt.defaults["HTTP_HOST"] = settings.HOST = "localhost"
    settings.ALLOWED_HOSTS = ["localhost"]
    assert unreached in pt.get(asked).content.decode()
    devices(station).update(last_seen_at=timezone.now())
    assert unreached not in pt.get(asked).content.decode()


def test_no_link_fills_a_code_in(world, pt):
    tablet = Client()
    code = shown_code(tablet)
    assert code not in pt.get(f"{PAIR}?code={code}").content.decode()


def test_a_tablet_outside_the_clinics_networks_is_not_let_in(world, pt, station):
    set_networks(world)
    code = shown_code(Client(REMOTE_ADDR=HOME))
    for answer in (enter_code(pt, code, station), let_in(pt, code, station)):
        assert "Connect it to the clinic’s network" in answer.content.decode()
    assert not devices(station).exists()
    assert AuditEntry.everywhere.filter(act="refused", about__contains="203.0.113.0/24").exists()
    let_in(pt, shown_code(Client(REMOTE_ADDR=CLINIC)), station)
    assert devices(station).exists()


# --- when it ends ---------------------------------------------------------------------------------


def end_account(world: World, approver: User) -> None:
    approver.is_active = False
    approver.save()


def take_role(world: World, approver: User) -> None:
    approver.role = Role.RESEARCHER
    approver.save()


def move(world: World, approver: User) -> None:
    approver.clinic = Clinic.everywhere.create(name="Elsewhere")
    approver.save()


def blind(world: World, approver: User) -> None:
    give_mark(running_study(world), approver, Task.ASSESSOR, None, NOW)


def leave_unused(world: World, approver: User) -> None:
    long_ago = timezone.now() - timedelta(days=30, minutes=1)
    Device.everywhere.filter(approver=approver).update(last_seen_at=long_ago)


def never_use(world: World, approver: User) -> None:
    long_ago = timezone.now() - timedelta(days=30, minutes=1)
    Device.everywhere.filter(approver=approver).update(last_seen_at=None, approved_at=long_ago)


def delete_account(world: World, approver: User) -> None:
    Device.everywhere.filter(approver=approver).update(approver=None)


ENDS = [end_account, take_role, move, blind, leave_unused, never_use, delete_account]


@pytest.mark.parametrize("end", ENDS)
def test_a_tablet_ends_for_good(world, approver, station, end):
    tablet = pair_tablet(signed_in(approver), station)
    session = open_session(world, station)
    token = tablet.cookies[COOKIE].value
    walk = f"/sessions/{session.pk}/"
    assert tablet.get(walk).status_code == 200
    end(world, approver)
    assert tablet.get(walk).status_code == 302  # to the sign-in
    program = Client(headers={"Authorization": f"Bearer {token}"})
    assert program.get(walk).status_code == 302
    assert len(shown_code(tablet)) == 6
    User.everywhere.filter(pk=approver.pk).update(is_active=True, role=Role.PT, clinic=world.clinic)
    assert not is_paired(tablet)
    assert "revoked" in world.lead.get("/stations/").content.decode()


def test_stations_say_that_a_tablet_has_ended_before_it_asks_again(world, approver, station):
    pair_tablet(signed_in(approver), station)
    end_account(world, approver)
    for page in ("/stations/", "/admin/rehab/device/"):
        assert "let it in again" in world.lead.get(page).content.decode(), page


def test_a_tablet_ends_with_its_station(world, pt, station):
    tablet = pair_tablet(pt, station)
    assert is_paired(tablet)
    station.delete()
    assert not is_paired(tablet)


def test_a_tablet_that_is_used_stays_and_its_cookie_is_as_old_as_its_pairing_may_be(pt, station):
    tablet = pair_tablet(pt, station)
    almost = timezone.now() - timedelta(days=29)
    Device.everywhere.update(last_seen_at=almost, approved_at=almost - timedelta(days=90))
    assert is_paired(tablet)
    assert tablet.cookies[COOKIE]["max-age"] == 30 * 24 * 3600


@pytest.mark.parametrize("kind", ["source", "robot"])
def test_programs_of_sensors_and_robots_have_no_approver_and_stay(world, station, kind):
    long_ago = timezone.now() - timedelta(days=80)
    device = Device(clinic=world.clinic, station=station, kind=kind, name="n")
    token = device.new_token()
    device.last_seen_at = long_ago
    device.save()
    assert find_device(token, timezone.now(), HOME) == device


def test_a_lead_who_gives_a_tablet_a_new_token_answers_for_it(world, approver, station):
    pair_tablet(signed_in(approver), station)
    end_account(world, approver)
    device = devices(station).get()
    page = world.lead.post(f"/devices/{device.pk}/").content.decode()
    assert "token" in page
    device.refresh_from_db()
    assert device.approver == world.people[Role.LEAD]


def test_a_tablet_of_an_approver_who_moved_can_be_revoked(world, approver, station):
    pair_tablet(signed_in(approver), station)
    move(world, approver)
    device = devices(station).get()
    world.lead.post(f"/devices/{device.pk}/", {"revoke": ""})
    device.refresh_from_db()
    assert device.is_revoked


# --- where it is ----------------------------------------------------------------------------------


def test_outside_the_clinic_a_tablet_needs_the_patients_consent_as_a_person_does(
    world, pt, station
):
    set_networks(world)
    tablet = pair_tablet(pt, station, Client(REMOTE_ADDR=CLINIC))
    session = open_session(world, station)
    walk = f"/sessions/{session.pk}/"
    assert tablet.get(walk).status_code == 200
    home = Client(REMOTE_ADDR=HOME)
    home.cookies = tablet.cookies
    assert home.get(walk).status_code == 404
    assert home.get("/tablet/state/").json() == {"paired": True, "go": ""}
    assert "outside the clinic’s networks" in home.get("/tablet/").content.decode()
    ended = {"state": "finished", "ended_at": timezone.now()}
    type(session).everywhere.filter(pk=session.pk).update(**ended)
    assert home.get(f"{walk}scores/").status_code == 404
    assert tablet.get(f"{walk}scores/").status_code == 200
    open_session(world, station)
    record_consent(world.patient, Purpose.REMOTE, None, NOW)
    assert home.get(walk).status_code == 200
    withdraw_consent(world.patient, Purpose.REMOTE, None, NOW)
    assert home.get(walk).status_code == 404
    Patient.everywhere.filter(pk=world.patient.pk).update(simulated=True)
    assert home.get(walk).status_code == 200


def test_a_tablet_outside_the_clinic_shows_no_boards(world, pt, station, monkeypatch):
    asked: list[Any] = []
    monkeypatch.setattr(views, "make_waiting_panels", lambda *made: asked.append(made))
    set_networks(world)
    tablet = pair_tablet(pt, station, Client(REMOTE_ADDR=CLINIC))
    home = Client(REMOTE_ADDR=HOME)
    home.cookies = tablet.cookies
    assert tablet.get("/tablet/board/").status_code == 204
    assert len(asked) == 1
    assert home.get("/tablet/board/").status_code == 204
    assert len(asked) == 1


# --- a reload at the wrong moment -----------------------------------------------------------------


def test_a_tablet_that_reloads_once_it_is_let_in_is_paired(pt, station):
    tablet = Client()
    let_in(pt, shown_code(tablet), station)
    answer = tablet.get("/tablet/")  # before it has asked for its state
    assert answer.headers["Location"] == "/tablet/"
    assert "Bay 4" in tablet.get("/tablet/").content.decode()
    assert is_paired(tablet)
    assert devices(station).count() == 1
