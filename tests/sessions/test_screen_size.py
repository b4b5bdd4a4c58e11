"""How large a screen is: set once on it, kept with the tablet, true in the mirror as well."""

from __future__ import annotations

import pytest
from django.test import Client

from rehab.sessions.models import TrainingSession
from rehab.stations.models import Device, Station
from tests.support.tablets import pair_tablet
from tests.support.walks import make_patient, make_session
from tests.support.world import World, client_of

pytestmark = pytest.mark.django_db

MEASURED = {"px_per_mm": "5.884", "distance_m": "2.0"}
SHOWN = 'data-px-per-mm="5.884" data-distance="2.0"'


@pytest.fixture
def session(world: World, station: Station) -> TrainingSession:
    return make_session(make_patient(world.clinic), station=station)


def walk_page(client: Client, session: TrainingSession, query: str = "") -> str:
    return " ".join(client.get(f"/sessions/{session.pk}/{query}").content.decode().split())


def test_a_tablet_keeps_its_size_and_the_mirror_shows_it(world, station, session):
    therapist = client_of(world)
    tablet = pair_tablet(therapist, station)
    assert "data-px-per-mm" not in walk_page(tablet, session)
    assert tablet.post("/screen-size/", MEASURED).headers["Location"] == "/tablet/"
    assert Device.everywhere.get(station=station).screen_distance_m == 2.0
    assert SHOWN in walk_page(tablet, session)
    assert SHOWN in walk_page(therapist, session, "?mirror=1")
    assert SHOWN not in walk_page(therapist, session)  # another screen


def test_any_other_browser_keeps_it_itself(world, session):
    therapist = client_of(world)
    therapist.post("/screen-size/", MEASURED)
    assert SHOWN in walk_page(therapist, session)
    assert SHOWN not in walk_page(client_of(world), session)
    therapist.cookies["garry_screen"] = "1e9,2"
    assert "data-px-per-mm" not in walk_page(therapist, session)


@pytest.mark.parametrize(
    ("given", "refused"),
    [
        ({"px_per_mm": ""}, "Lay a card on the screen first"),
        ({"px_per_mm": "400"}, "less than or equal to 40"),
        ({"distance_m": "9"}, "Select a valid choice"),
    ],
)
def test_what_no_screen_has_is_refused(world, given, refused):
    page = client_of(world).post("/screen-size/", MEASURED | given)
    assert refused in page.content.decode()


@pytest.mark.parametrize(
    ("side", "column"), [("center", "center"), ("in_right", "right"), ("in_left", "left")]
)
def test_a_side_is_a_layout(world, station, side, column):
    patient = make_patient(world.clinic, screen_side=side)
    page = walk_page(client_of(world), make_session(patient, station=station))
    assert f'data-column="{column}"' in page
