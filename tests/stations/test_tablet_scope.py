"""A tablet shows the patient who walks, and the one who has just walked, and nobody else."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.test import Client
from django.urls import reverse

from rehab.people.consent.services import active_consents
from rehab.people.models import Patient
from rehab.sessions.log import SessionEvent, Step
from rehab.sessions.models import ENDED_VISIBLE_FOR, TrainingSession
from rehab.stations.models import Device
from tests.support.world import NOW, World

pytestmark = pytest.mark.django_db
MINUTE = timedelta(minutes=1)


@pytest.fixture
def tablet(world: World) -> Device:
    return world.add_tablet()[1]


@pytest.fixture
def screen(world: World) -> Client:
    return world.add_tablet()[0]


def walk(world: World, state: str, began=None, ended=None) -> TrainingSession:
    """Return another session at the world's station."""
    copied = TrainingSession.everywhere.get(pk=world.session.pk)
    copied.pk, copied.state = None, state
    copied.started_at, copied.ended_at = began, ended
    copied._state.adding = True
    copied.save()
    return copied


def end(session: TrainingSession, moment) -> None:
    TrainingSession.everywhere.filter(pk=session.pk).update(
        started_at=moment - 20 * MINUTE, ended_at=moment
    )


def seen(tablet: Device) -> set[int]:
    return set(TrainingSession.objects.visible_to(tablet).values_list("pk", flat=True))


@pytest.mark.parametrize("state", ["ready", "running", "paused"])
def test_it_sees_the_open_session_and_none_from_before_the_last(world, tablet, state):
    end(world.session, NOW - 40 * MINUTE)
    last = walk(world, "finished", NOW - 30 * MINUTE, NOW - 10 * MINUTE)
    opened = walk(world, state)
    assert seen(tablet) == {opened.pk, last.pk}
    assert not Step.objects.visible_to(tablet).exists()  # they are of the session before
    assert not SessionEvent.objects.visible_to(tablet).exists()


def test_it_sees_the_last_one_until_the_next_starts(world, tablet):
    end(world.session, NOW - 5 * MINUTE)
    assert seen(tablet) == {world.session.pk}
    assert Step.objects.visible_to(tablet).exists()
    running = walk(world, "running", NOW - MINUTE)
    assert seen(tablet) == {running.pk}


@pytest.mark.parametrize("state", ["finished", "aborted"])
def test_it_sees_the_last_one_for_a_quarter_of_an_hour(world, tablet, state):
    TrainingSession.everywhere.update(state=state)
    end(world.session, NOW - ENDED_VISIBLE_FOR + MINUTE)
    assert seen(tablet) == {world.session.pk}
    end(world.session, NOW - ENDED_VISIBLE_FOR)
    assert seen(tablet) == set()


def test_another_stations_patient_does_not_count(world, tablet):
    elsewhere = walk(world, "running", NOW - MINUTE)
    elsewhere.station = world.add_station()
    elsewhere.save()
    end(world.session, NOW - 5 * MINUTE)
    assert seen(tablet) == {world.session.pk}


def test_nobody_at_it_opens_an_earlier_session_or_takes_its_patient_off_boards(world, screen):
    end(world.session, NOW - 40 * MINUTE)
    walk(world, "finished", NOW - 30 * MINUTE, NOW - 10 * MINUTE)
    session = {"session_id": world.session.pk}
    for page in ("walk", "scores"):
        assert screen.get(reverse(page, kwargs=session)).status_code == 404
    assert screen.post(reverse("leave-boards", kwargs=session)).status_code == 404
    assert Patient.everywhere.get(pk=world.patient.pk).boards == "clinic"


def test_a_patient_at_it_leaves_boards_after_the_own_session(world, screen):
    end(world.session, NOW - 5 * MINUTE)
    session = {"session_id": world.session.pk}
    assert screen.get(reverse("scores", kwargs=session)).status_code == 200
    assert screen.post(reverse("leave-boards", kwargs=session)).status_code == 302
    assert Patient.everywhere.get(pk=world.patient.pk).boards == "own"
    assert "boards" not in active_consents(world.patient)


def test_a_source_is_still_told_that_a_session_has_ended(world):
    end(world.session, NOW - 40 * MINUTE)
    assert seen(world.device) == {world.session.pk}
