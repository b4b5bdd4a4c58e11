"""Sessions are found by what one remembers of them; rows' pages offer what one may do."""

from __future__ import annotations

import re
from datetime import datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo

import pytest
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.urls import reverse
from django.utils import timezone

from rehab.boards.models import Leaderboard
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.sessions.corrections import SessionCorrection
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.presets import Preset
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol, ProtocolPhase
from rehab.stations.models import Device, Station
from rehab.stations.tokens import find_device
from tests.support.admin_actions import act
from tests.support.walks import make_patient, make_session, strides, walk
from tests.support.world import NOW, World, build_world, client_of

pytestmark = pytest.mark.django_db

SESSIONS = "/admin/rehab/trainingsession/"


def patient_of(world: World, name: str) -> Patient:
    return make_patient(world.clinic, name)


# --- finding sessions ---------------------------------------------------------------------------


@pytest.fixture
def walked(world) -> dict[str, TrainingSession]:
    """Four sessions of two people; the world's own is a fifth."""
    rosa, omar = patient_of(world, "Rosa"), patient_of(world, "Omar")
    made = {
        "weak": walk(rosa, "positive", strides(2, 8), days_ago=9),
        "strong": walk(rosa, "positive", strides(9, 1), days_ago=5),
        "lost": walk(omar, "negative", strides(5, 5), days_ago=5),
        "told": walk(omar, "explicit", strides(5, 5), days_ago=1),
    }
    station = Station.everywhere.create(clinic=world.clinic, name="Window")
    TrainingSession.everywhere.filter(pk=made["lost"].pk).update(station=station)
    return made


def found(client: Client, walked: dict[str, TrainingSession], **asked: Any) -> set[str]:
    page = client.get(SESSIONS, asked)
    assert page.status_code == 200, page.headers.get("Location")
    keys = {int(key) for key in re.findall(r"/sessions/(\d+)/details/", page.content.decode())}
    return {name for name, session in walked.items() if session.pk in keys}


def test_sessions_are_found_by_day_person_place_type_and_figures(world, walked):
    client = client_of(world)
    rosa = walked["weak"].patient_id
    place = Station.everywhere.get(name="Window").pk
    day = (NOW - timedelta(days=5)).date().isoformat()
    assert found(client, walked) == {"weak", "strong", "lost", "told"}
    assert found(client, walked, first=day, last=day) == {"strong", "lost"}
    assert found(client, walked, last=day) == {"weak", "strong", "lost"}
    assert found(client, walked, who=rosa) == {"weak", "strong"}
    assert found(client, walked, who=rosa, first=day) == {"strong"}
    assert found(client, walked, place=place) == {"lost"}
    assert found(client, walked, valence__exact="explicit") == {"told"}
    assert found(client, walked, hits_min="50", hits_max="89") == {"lost", "told"}
    assert found(client, walked, hits_min="90") == {"strong"}
    assert found(client, walked, score_max="0") == {"lost"}
    assert found(client, walked, score_min="2,5") == {"strong"}
    assert found(client, walked, goal_min="1.5", goal_max="2") == set(walked)
    assert found(client, walked, goal_min="2.1") == set()
    assert found(client, walked, q="Omar", hits_max=50, valence__exact="negative") == {"lost"}


def test_what_nobody_walked_is_listed_when_it_is_asked_for(world, walked):
    TrainingSession.everywhere.filter(pk=walked["told"].pk).update(simulated=True)
    client = client_of(world)
    assert found(client, walked) == {"weak", "strong", "lost"}
    assert found(client, walked, also="simulated") == set(walked)
    assert found(client, walked, also="simulated", weeks="4", q="Omar") == {"lost", "told"}


def test_the_last_weeks_are_listed(world, walked):
    for name, weeks in (("weak", 13), ("strong", 5)):
        at = timezone.now() - timedelta(weeks=weeks)
        TrainingSession.everywhere.filter(pk=walked[name].pk).update(created_at=at)
    now = {"created_at": timezone.now()}
    TrainingSession.everywhere.filter(pk__in=[walked["lost"].pk, walked["told"].pk]).update(**now)
    client = client_of(world)
    assert found(client, walked, weeks="4") == {"lost", "told"}
    assert found(client, walked, weeks="") == found(client, walked, weeks="x") == set(walked)
    assert found(client, walked, weeks="12") == {"strong", "lost", "told"}
    assert found(client, walked, weeks="52") == set(walked)


def test_a_session_without_figures_says_none_of_them(world, walked):
    ready = make_session(patient_of(world, "Ada"))
    page = client_of(world).get(f"{SESSIONS}{ready.pk}/change/").content.decode()
    assert "Hit rate" in page
    assert "None" not in page


def test_days_are_the_clinics_own(world, walked):
    Clinic.everywhere.filter(pk=world.clinic.pk).update(time_zone="Pacific/Auckland")
    begun = datetime(2026, 11, 10, 0, 30, tzinfo=ZoneInfo("Pacific/Auckland"))
    TrainingSession.everywhere.filter(pk=walked["told"].pk).update(started_at=begun)
    client = client_of(world)
    assert found(client, walked, first="2026-11-10", last="2026-11-10") == {"told"}
    assert found(client, walked, first="2026-11-09", last="2026-11-09") == set()


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"hits_min": "many"}, "Enter a number"),
        ({"hits_min": "nan"}, "Enter a number"),
        ({"hits_min": "90", "hits_max": "80"}, "The first number must not be larger"),
        ({"first": "2026-13-01"}, "Enter a valid date"),
        ({"first": "0001-01-01"}, "Give a day of the years 1900 to 2999."),
        ({"last": "9999-12-31"}, "Give a day of the years 1900 to 2999."),
        ({"first": "2026-11-02", "last": "2026-11-01"}, "It ends before it starts."),
        ({"who": "999999"}, "Select a valid choice"),
        ({"hits_max": "101"}, "Give 0 to 100 %"),
    ],
)
def test_what_cannot_be_looked_for_is_said_and_finds_nothing(world, walked, asked, words):
    page = client_of(world).get(SESSIONS, asked)
    assert words in page.content.decode()
    assert found(client_of(world), walked, **asked) == set()


def test_what_was_looked_for_stays_in_the_form_beside_the_other_filters(world, walked):
    asked = {"hits_min": "50", "state__exact": "finished"}
    page = client_of(world).get(SESSIONS, asked).content.decode()
    assert re.search(r'name="hits_min" value="50"', page)
    assert '<input type="hidden" name="state__exact" value="finished">' in page
    assert "hits_min=50" in page  # in the links of the other filters


def test_a_researcher_finds_by_pseudonym_alone(world, walked):
    client = client_of(world, Role.RESEARCHER)
    rosa = walked["weak"].patient
    for name in ("weak", "told"):
        record_consent(walked[name].patient, Purpose.RESEARCH, None, NOW)
    assert found(client, walked, who=rosa.pseudonym) == {"weak", "strong"}
    page = client.get(SESSIONS).content.decode()
    assert "Rosa" not in page
    assert "Window" in page  # the station's name stands beside a session, as in its details
    assert found(client, walked, who=str(rosa.pk)) == set()


def test_another_clinics_patient_is_no_choice(world, walked):
    birch = build_world("birch")
    page = client_of(world).get(SESSIONS, {"who": birch.patient.pk}).content.decode()
    assert "Select a valid choice" in page


# --- lists cost the same, however long they are --------------------------------------------------


def multiply(world: World) -> None:
    """Add five more of everything that lists show."""
    for number in range(5):
        patient = patient_of(world, f"More {number}")
        session = walk(patient, "positive", strides(3, 1), days_ago=number)
        SessionCorrection.everywhere.create(
            session=session, field="note", reason="why", by=world.people[Role.PT], at=NOW
        )
        Leaderboard.everywhere.create(clinic=world.clinic, name=f"More {number}")
        station = Station.everywhere.create(clinic=world.clinic, name=f"More {number}")
        for kind in Device.Kind.values:
            name = f"{kind}-{number}"
            Device(
                clinic=world.clinic, station=station, kind=kind, name=name, token_hash=name
            ).save()
        TrainingSession.everywhere.filter(patient=patient).update(station=station)
        User.everywhere.create_user(f"more-{number}", role=Role.PT, clinic=world.clinic)
        protocol = Protocol.everywhere.create(clinic=world.clinic, name=f"More {number}")
        protocol.phases.create(position=1, kind="training", name="one", feedback=True)
        Preset.everywhere.create(
            clinic=world.clinic,
            name=f"More {number}",
            measure=MeasureDefinition.everywhere.get(clinic=None, slug="a2"),
            protocol=protocol,
        )


@pytest.mark.wide
@pytest.mark.parametrize(
    "name",
    [
        *("trainingsession", "step", "sessionevent", "sessionmetric", "sessioncorrection"),
        *("patient", "user", "station", "device", "protocol", "preset", "leaderboard"),
    ],
)
def test_a_list_costs_the_same_however_long_it_is(world, name):
    client = client_of(world, Role.LEAD)
    url = f"/admin/rehab/{name}/"
    client.get(url)

    def cost() -> tuple[int, int]:
        with CaptureQueriesContext(connection) as queries:
            page = client.get(url)
        assert page.status_code == 200
        return len(queries), page.content.decode().count("<tr")

    before, rows = cost()
    multiply(world)
    after, more = cost()
    assert more > rows
    assert after == before
    assert after <= 16


# --- what a row's page offers, and what goes with it ---------------------------------------------


def test_a_token_is_renewed_and_revoked_from_the_devices_page(world):
    page = reverse("admin:rehab_device_change", args=[world.device.pk])
    answer = act(world, "device", "renew_tokens", world.device.pk, Role.LEAD)
    token = re.search(r'class="token">(\S+?)<', answer.content.decode()).group(1)
    assert find_device(token, NOW) == world.device
    assert find_device(world.token, NOW) is None
    act(world, "device", "revoke_tokens", world.device.pk, Role.LEAD)
    told = client_of(world, Role.LEAD).get(page).content.decode()
    assert "revoked" in told
    seen_by_pt = client_of(world).get(page).content.decode()
    assert "Disconnect this device" in told
    assert "Disconnect this device" not in seen_by_pt
    assert 'name="kind"' not in told  # it stays what it is
    Device.everywhere.filter(pk=world.device.pk).update(builtin=True)  # keys from the server
    assert "Disconnect this device" not in client_of(world, Role.LEAD).get(page).content.decode()


def test_devices_that_are_away_come_first_and_simulated_patients_last(world):
    station, lead = world.rows[Station], client_of(world, Role.LEAD)
    for name, state in (
        ("Gone", {"revoked_at": NOW}),
        ("Here", {"last_seen_at": NOW}),
        ("Away", {"last_seen_at": NOW - timedelta(days=2)}),
        ("New", {}),
    ):
        Device.everywhere.create(
            clinic=world.clinic, station=station, kind="source", name=name, token_hash=name, **state
        )
    page = lead.get("/admin/rehab/device/").content.decode()
    assert re.findall(r">(Gone|Here|Away|New)</a>", page) == ["New", "Away", "Here", "Gone"]
    assert "sorted ascending" not in page  # by the name alone
    make_patient(world.clinic, "Zoe")
    demo = make_patient(world.clinic, "Anna")
    Patient.everywhere.filter(pk=demo.pk).update(simulated=True)
    page = lead.get("/admin/rehab/patient/").content.decode()
    assert page.index(">Zoe<") < page.index(">Anna<")


def test_a_stations_page_shows_its_devices_and_their_state(world):
    Device.everywhere.filter(pk=world.device.pk).update(revoked_at=NOW)
    station = world.rows[Station]
    url = f"/admin/rehab/station/{station.pk}/change/"
    page = client_of(world, Role.LEAD).get(url).content.decode()
    assert reverse("admin:rehab_device_change", args=[world.device.pk]) in page
    assert '<span class="badge free">– revoked</span>' in page
    assert f"?station={station.pk}" in page
    Device.everywhere.filter(pk=world.device.pk).update(revoked_at=None, last_seen_at=None)
    listed = client_of(world, Role.LEAD).get("/admin/rehab/station/").content.decode()
    assert '<span class="badge warn">! never seen</span>' in listed


def test_deleting_says_what_goes_and_what_stays_behind(world):
    protocol, preset = world.rows[Protocol], world.rows[Preset]
    page = client_of(world).get(f"/admin/rehab/protocol/{protocol.pk}/delete/").content.decode()
    assert f"1 preset that uses it is deleted, too: {preset.name}." in " ".join(page.split())
    assert world.rows[ProtocolPhase].name in page
    assert "Stays, without its protocol: sessions (1)" in page
    station = world.rows[Station]
    lead = client_of(world, Role.LEAD)
    page = lead.get(f"/admin/rehab/station/{station.pk}/delete/").content.decode()
    assert world.device.name in page
    assert "Stays, without its station: sessions (1)" in page
    lead.post(f"/admin/rehab/station/{station.pk}/delete/", {"post": "yes"})
    world.session.refresh_from_db()
    assert world.session.station is None
    assert not Device.everywhere.filter(pk=world.device.pk).exists()
