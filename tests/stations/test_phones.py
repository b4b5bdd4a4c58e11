"""Phones as sensors: who pairs one and for how long; its page is open to strangers."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest
from django.test import Client
from django.utils import timezone

from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.sessions.forms.initial import initial_choices
from rehab.sessions.forms.setup import SessionForm
from rehab.stations.builtin import first_station, issue_builtin_token
from rehab.stations.models import WORN_LIFETIME, Device
from rehab.stations.tokens import find_device
from rehab.studies.blinding import Task, give_mark
from tests.support.studies import running_study
from tests.support.tablets import shown_code
from tests.support.world import NOW, World, signed_in

pytestmark = pytest.mark.django_db


def test_a_therapist_pairs_a_phone_for_a_day(pt: Client, world: World):
    station = world.add_station()
    assert "Show the QR code" in pt.get("/phones/pair/", secure=True).content.decode()
    refused = pt.get("/phones/pair/").content.decode()
    assert "Show the QR code" not in refused
    assert 'href="/https/"' in refused
    wish = {"station": station.pk, "side": "left"}
    answer = pt.post("/phones/pair/", wish)
    assert "no-store" in answer.headers["Cache-Control"]
    page = answer.content.decode()
    assert "<svg" in page
    assert "secure address" in page
    assert "secure address" not in pt.post("/phones/pair/", wish, secure=True).content.decode()
    device = Device.everywhere.filter(station=station).order_by("pk")[0]
    assert (device.kind, device.name) == ("source", "Phone, left shin")
    assert (device.place, device.side) == ("shank", "left")
    assert timedelta(0) < device.token_expires_at - timezone.now() <= WORN_LIFETIME
    assert device.has_expired(timezone.now() + WORN_LIFETIME)
    assert AuditEntry.everywhere.filter(act=Act.TOKEN, about__contains=device.name).exists()


def test_a_new_token_of_a_phone_ends_as_early_as_the_first(pt: Client, world: World):
    station = world.add_station()
    pt.post("/phones/pair/", {"station": station.pk, "side": "left"})
    device = Device.everywhere.get(station=station)
    first = device.token_expires_at
    pt.post(f"/devices/{device.pk}/")
    device.refresh_from_db()
    assert first <= device.token_expires_at <= timezone.now() + WORN_LIFETIME


TRIAL = "/first-steps/phone/"
WAYS = {"paired": "/phones/pair/", "tried": f"{TRIAL}open/", "by its code": TRIAL}


def ask(who: Client, way: str, wish: dict[str, Any], **request: Any) -> tuple[str, str]:
    """Return the token that a way to one gives, and what the person reads then.

    It is behind the square, in a trial's address, or where the phone whose code was compared goes.
    """
    if way == "paired":
        page = who.post(WAYS[way], wish, **request).content.decode()
        return page.partition("token=")[2].partition("&")[0], page
    who.post(TRIAL, {"side": "left"}, **request)
    phone = Client(**request)
    if way == "by its code":
        sent = {"step": "phone", "code": shown_code(phone), "station": wish["station"]}
        page = who.post(TRIAL, sent).content.decode()
        assert not phone.get("/tablet/state/").json()["go"]  # it has not been compared
        page += who.post(TRIAL, sent | {"compared": "yes"}).content.decode()
        go = phone.get("/tablet/state/").json()["go"]
        assert "garry_tablet" not in phone.cookies
    else:
        answer = who.post(WAYS[way], wish, follow=True, **request)
        page, go = answer.content.decode(), "".join(url for url, _ in answer.redirect_chain)
    return go.partition("token=")[2].partition("&")[0], page


@pytest.mark.parametrize("way", WAYS)
def test_a_blinded_assessor_is_given_no_phones_token(world: World, way):
    """A source is told the feedback type of the session that is open at its station."""
    wish = {"station": world.add_station().pk, "side": "left"}
    assessor = User.everywhere.create_user("assessor", role=Role.PT, clinic=world.clinic)
    give_mark(running_study(world), assessor, Task.ASSESSOR, None, NOW)
    client = signed_in(assessor)
    token, page = ask(client, way, wish)
    assert not token
    assert AuditEntry.everywhere.filter(act=Act.REFUSED, by=assessor).exists()
    assert "assessor" in page
    assert ask(world.pt, way, wish)[0]


@pytest.mark.parametrize("way", WAYS)
def test_no_phones_token_is_given_outside_the_clinics_networks(world: World, way):
    wish = {"station": world.add_station().pk, "side": "left"}
    type(world.clinic).everywhere.update(networks="192.168.7.0/24")
    afar: dict[str, Any] = {"REMOTE_ADDR": "203.0.113.9"}
    token, page = ask(world.pt, way, wish, **afar)
    assert not token
    assert "Connect it to the clinic’s network" in page


@pytest.mark.parametrize("way", WAYS)
def test_a_phones_token_ends_with_who_paired_it_and_after_a_day(world: World, way):
    """Also one that was only tried: it is the station's, whatever is walked there next."""
    station, who = world.add_station(), world.people[Role.PT]
    wish = {"station": station.pk, "side": "left"}
    token, _page = ask(world.pt, way, wish)
    now = timezone.now()
    assert find_device(token, now) is not None
    assert find_device(token, now + WORN_LIFETIME + timedelta(minutes=1)) is None
    User.everywhere.filter(pk=who.pk).update(is_active=False)
    assert find_device(token, now) is None
    User.everywhere.filter(pk=who.pk).update(is_active=True)
    assert find_device(token, now) is None


def test_a_phone_that_is_late_gets_no_token_that_nobody_answers_for(world: World):
    """Meanwhile the server has run a source of its own there."""
    station, phone = first_station(world.clinic), Client()
    world.pt.post(TRIAL, {"side": "left"})
    sent = {"step": "phone", "code": shown_code(phone), "station": station.pk, "compared": "yes"}
    world.pt.post(TRIAL, sent)
    issue_builtin_token(station, Device.Kind.SOURCE)
    assert not phone.get("/tablet/state/").json()["paired"]


def test_a_phone_that_is_let_in_leaves_the_one_before_out(world: World):
    wish = {"station": first_station(world.clinic).pk}
    first, _page = ask(world.pt, "by its code", wish)
    second, _page = ask(world.pt, "tried", wish)
    now = timezone.now()
    assert find_device(first, now) is None
    assert find_device(second, now) is not None


@pytest.mark.parametrize("wrong", [{"station": "0"}, {"side": "both"}])
def test_what_cannot_be_paired_is_refused(pt: Client, world: World, wrong):
    wish = {"station": world.add_station().pk, "side": "right"} | wrong
    page = pt.post("/phones/pair/", wish).content.decode()
    assert "Choose a station and a leg." in page
    assert not Device.everywhere.filter(name__startswith="Phone").exists()


def test_the_page_of_a_phone_is_for_whoever_scans(client: Client):
    page = client.get("/sensor/").content.decode()
    assert "garry/sensor/detector" in page
    assert "no-referrer" in page
    assert '<html lang="de"' in client.get("/sensor/?language=de").content.decode()
    assert client.get("/sensor/?language=xx").status_code == 200


def test_setup_offers_what_the_paired_sensors_measure(pt: Client, world: World):
    station, patient = world.add_station(), world.add_patient()
    setup = f"/patients/{patient.pk}/new/"
    assert "ankle push-off power A2" in pt.get(setup).content.decode()
    for side in ("left", "right"):
        pt.post("/phones/pair/", {"station": station.pk, "side": side})
        page = pt.get(setup).content.decode()
        assert "shank lean" in page
        assert "ankle push-off power A2" not in page
        assert "foot strike angle" not in page
        assert ("difference of step times" in page) is (side == "right")
    chosen = SessionForm(
        initial=initial_choices(patient, world.people[Role.PT]),
        patient=patient,
        by=world.people[Role.PT],
    )
    assert chosen.chosen_measure.slug == "shank_stance"


def test_a_trial_walks_a_simulated_leg(client: Client):
    walk = client.get("/sensor/trial.json").json()
    assert len(walk["walk"]) == 72  # a stride
    assert [len(row) for row in walk["stand"]] == [7] * 300
