"""A tablet comes to a station by a code; from then on sessions appear on it by themselves."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.core.cache import cache
from django.test import Client
from django.utils import timezone

from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.random_codes import ALPHABET
from rehab.people.roles import Role
from rehab.people.sign_in.tokens import hash_token
from rehab.people.token_buckets import TokenBuckets
from rehab.sessions.pages.tablet import PAIRING_COOKIE
from rehab.stations import pairing, tablets
from rehab.stations.models import Device, Pairing, Station
from tests.support.tablets import PAIR, enter_code, is_paired, let_in, pair_tablet, shown_code
from tests.support.world import World, build_world, signed_in

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def fresh_cache():
    cache.clear()


@pytest.fixture
def station(world: World) -> Station:
    return world.add_station()


def paired(tablet: Client, pt: Client, station: Station) -> Device:
    pair_tablet(pt, station, tablet)
    return Device.everywhere.get(station=station, kind="tablet")


def test_a_tablet_shows_one_code_until_it_is_let_in(pt, station):
    tablet = Client()
    code = shown_code(tablet)
    assert len(code) == 6
    assert set(code) <= set(ALPHABET)
    assert shown_code(tablet) == code  # also after a reload
    assert shown_code(Client()) != code
    assert tablet.get("/tablet/state/").json() == {"paired": False, "go": ""}
    answer = let_in(pt, code.lower(), station)
    assert answer.headers["Location"] == "/start/"
    assert tablet.get("/tablet/state/").json() == {"paired": True, "go": "/tablet/"}
    cookie = tablet.cookies[tablets.COOKIE]
    assert cookie["httponly"]
    assert cookie["samesite"] == "Lax"
    device = Device.everywhere.get(station=station)
    assert cookie.value not in device.token_hash
    assert "Bay 4" in tablet.get("/tablet/").content.decode()
    assert not Pairing.everywhere.filter(code=code).exists()


def test_a_code_opens_once_and_for_five_minutes(pt, station):
    tablet = Client()
    code = shown_code(tablet)
    Pairing.everywhere.update(expires_at=timezone.now() - timedelta(seconds=1))
    page = let_in(pt, code, station).content.decode()
    assert "No tablet shows this code now" in page
    assert tablet.get("/tablet/state/").json()["go"] == "/tablet/"
    new = shown_code(tablet)
    assert new != code
    for expected in (302, 200):
        answer = let_in(pt, new, station)
        assert answer.status_code == expected
    assert Device.everywhere.filter(station=station).count() == 1


def test_the_token_is_given_to_the_tablet_that_showed_the_code_and_once(pt, station):
    tablet, thief = Client(), Client()
    code = shown_code(tablet)
    shown_code(thief)
    let_in(pt, code, station)
    assert not thief.get("/tablet/state/").json()["paired"]
    copy = Client()
    copy.cookies["garry_pairing"] = tablet.cookies["garry_pairing"].value
    assert tablet.get("/tablet/state/").json()["paired"]
    assert not copy.get("/tablet/state/").json()["paired"]


def test_wrong_codes_are_few(pt, station, monkeypatch):
    monkeypatch.setattr(pairing, "attempts", TokenBuckets(pairing.MAX_ATTEMPTS, 300.0))
    for _ in range(pairing.MAX_ATTEMPTS):
        page = enter_code(pt, "XXXXXX", station)
        assert "No tablet shows this code" in page.content.decode()
    code = shown_code(Client())
    page = let_in(pt, code, station).content.decode()
    assert "Too many wrong codes" in page
    assert not Device.everywhere.filter(station=station).exists()


def test_a_flood_of_strangers_ends_somewhere(monkeypatch):
    monkeypatch.setattr(pairing, "MAX_PENDING", 3)
    pages = [Client().get("/tablet/") for _ in range(4)]
    assert [page.status_code for page in pages] == [200, 200, 200, 503]
    assert "try again in five minutes" in pages[-1].content.decode()


def test_strangers_of_many_addresses_leave_room_for_a_clinics_network(world, monkeypatch):
    monkeypatch.setattr(pairing, "MAX_PENDING", 3)
    monkeypatch.setattr(pairing, "MAX_PENDING_KNOWN", 5)
    signed_in = {"act": Act.SIGN_IN, "clinic": world.clinic, "address": "198.51.100.0/24"}
    AuditEntry.everywhere.create(**signed_in)
    flood = [Client(REMOTE_ADDR=f"203.0.{net}.7").get("/tablet/") for net in range(6)]
    assert [page.status_code for page in flood] == [200] * 3 + [503] * 3
    clinic = [Client(REMOTE_ADDR=f"198.51.100.{host}").get("/tablet/") for host in range(3)]
    assert [page.status_code for page in clinic] == [200, 200, 503]


def test_codes_cannot_be_filled_by_forged_addresses(settings, monkeypatch):
    settings.PROXIES = 1
    monkeypatch.setattr(pairing, "MAX_PENDING_PER_ADDRESS", 3)
    for last in range(20):  # past the proxy, straight from the internet
        stranger = Client(REMOTE_ADDR="8.8.8.8")
        stranger.get("/tablet/", headers={"X-Forwarded-For": f"198.51.{last}.7"})
    assert Pairing.everywhere.count() == 3


def test_a_flood_from_one_address_shuts_no_other_clinic_out(monkeypatch):
    monkeypatch.setattr(pairing, "MAX_PENDING", 6)
    monkeypatch.setattr(pairing, "MAX_PENDING_PER_ADDRESS", 3)
    monkeypatch.setattr(pairing, "starts", TokenBuckets(8, 300.0))
    early, elsewhere = Client(REMOTE_ADDR="203.0.113.9"), Client(REMOTE_ADDR="203.0.113.9")
    code = shown_code(early)
    pages = [Client(REMOTE_ADDR="198.51.100.7").get("/tablet/") for _ in range(10)]
    assert [page.status_code for page in pages] == [200] * 8 + [429] * 2
    assert "Too many codes were asked for" in pages[-1].content.decode()
    codes = [page.context["code"] for page in pages[:8]]
    left = Pairing.everywhere.filter(code__in=codes).order_by("pk")
    assert list(left.values_list("code", flat=True)) == codes[-3:]  # the oldest gave way
    assert shown_code(early) == code
    assert elsewhere.get("/tablet/").status_code == 200
    cache.clear()  # five minutes later; of an IPv6 address the network counts
    Pairing.everywhere.all().delete()
    first = shown_code(Client(REMOTE_ADDR="2001:db8::1"))
    for last in range(2, 5):
        shown_code(Client(REMOTE_ADDR=f"2001:db8::{last}"))
    assert not Pairing.everywhere.filter(code=first).exists()


def test_a_tablet_that_was_let_in_gives_way_to_none(pt, station, monkeypatch):
    monkeypatch.setattr(pairing, "MAX_PENDING_PER_ADDRESS", 1)
    tablet = Client()
    let_in(pt, shown_code(tablet), station)
    assert shown_code(Client())
    assert tablet.get("/tablet/state/").json()["paired"] is True


def test_no_pairing_is_forged(world, pt, station):
    tablet, other = Client(), Client()
    code = shown_code(tablet)
    form = {"code": code, "station": station.pk, "compared": "yes"}
    for secret in ("", code, hash_token(code), Pairing.everywhere.get(code=code).secret_hash):
        other.cookies[PAIRING_COOKIE] = secret
        assert shown_code(other) != code
        other.cookies.clear()
    elsewhere = signed_in(world.people[Role.PT], enforce_csrf_checks=True)
    assert elsewhere.post(PAIR, form).status_code == 403  # a page of another site sends it
    pt.get(PAIR, form)
    tablet.post(PAIR, form)
    assert not is_paired(tablet)
    assert not Device.everywhere.filter(station=station).exists()
    let_in(pt, code, station)
    other.cookies[PAIRING_COOKIE] = code
    assert not is_paired(other)
    assert is_paired(tablet)


def test_nobody_pairs_to_a_station_of_another_clinic(pt):
    birch = build_world("birch")
    form = {"code": shown_code(Client()), "station": birch.rows[Station].pk}
    assert "Choose a station" in pt.post("/tablets/pair/", form).content.decode()


def test_a_session_of_its_station_appears_and_no_other(world, pt, station):
    tablet = Client()
    paired(tablet, pt, station)
    assert tablet.get("/tablet/state/").json() == {"paired": True, "go": ""}
    session = world.session
    assert tablet.get(f"/sessions/{session.pk}/").status_code == 404  # of another station
    type(session).everywhere.filter(pk=session.pk).update(station=station, state="ready")
    there = f"/sessions/{session.pk}/"
    assert tablet.get("/tablet/state/").json()["go"] == there
    assert tablet.get("/tablet/").headers["Location"] == there
    page = tablet.get(there).content.decode()
    assert world.patient.nickname in page
    assert 'class="walk alone"' in page
    ended = {"state": "finished", "ended_at": timezone.now()}
    type(session).everywhere.filter(pk=session.pk).update(**ended)
    assert tablet.get(there).headers["Location"] == f"{there}scores/"
    scores = tablet.get(f"{there}scores/").content.decode()
    assert 'href="/tablet/"' in scores
    for elsewhere in ("/start/", f"{there}monitor/", f"/patients/{world.patient.pk}/"):
        assert tablet.get(elsewhere).headers["Location"].startswith("/sign-in/")


def test_a_revoked_tablet_shows_a_code_again(pt, station):
    tablet = Client()
    device = paired(tablet, pt, station)
    Device.everywhere.filter(pk=device.pk).update(revoked_at=timezone.now())
    assert len(shown_code(tablet)) == 6


def test_a_tablet_that_is_revoked_while_it_claims_its_token_stays_revoked(pt, station):
    tablet = Client()
    let_in(pt, shown_code(tablet), station)
    secret = tablet.cookies["garry_pairing"].value
    found = pairing.find_pairing(secret, timezone.now())
    assert found is not None
    Device.everywhere.filter(station=station).update(revoked_at=timezone.now())
    token = pairing.claim_token(found)
    assert token is not None
    assert tablets.find_tablet(token, timezone.now()) is None
