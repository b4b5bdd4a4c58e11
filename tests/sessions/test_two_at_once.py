"""Two act at the same moment: one session is open at a station, one correction is made."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from typing import Any

import pytest
from django.db import connections
from django.urls import reverse

from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.corrections import SessionCorrection
from rehab.sessions.forms.setup import SessionForm
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.default_protocols import install_defaults
from rehab.stations.models import Station
from tests.support.forms import session_form
from tests.support.programs import program_of
from tests.support.walks import make_patient
from tests.support.world import World, build_world, client_of

pytestmark = pytest.mark.postgres


@pytest.fixture
def world(transactional_db: None) -> World:
    install_defaults()
    return build_world("amber")


@pytest.fixture
def station(world: World) -> Station:
    return Station.everywhere.create(clinic=world.clinic, name="Window")


@pytest.fixture
def people(world: World) -> list[Patient]:
    return [make_patient(world.clinic, name) for name in ("Rosa", "Omar")]


def at_once(*acts: Callable[[], Any]) -> list[Any]:
    """Do things at the same moment, each in a thread of its own with its own connection."""
    gate = Barrier(len(acts))

    def go(act: Callable[[], Any]) -> Any:
        try:
            gate.wait(20)
            return act()
        finally:
            connections.close_all()

    with ThreadPoolExecutor(len(acts)) as pool:
        return [one.result(30) for one in [pool.submit(go, act) for act in acts]]


def open_at(station: Station) -> int:
    return TrainingSession.everywhere.filter(station=station, state="ready").count()


def test_of_two_forms_that_were_both_free_to_go_one_creates(world, station, people):
    for _ in range(5):
        forms = [
            SessionForm(session_form(station), patient=patient, by=world.people[Role.PT])
            for patient in people
        ]
        assert all(form.is_valid() for form in forms)
        made = at_once(*(form.create for form in forms))
        assert open_at(station) == 1
        assert made.count(None) == 1
        refused = forms[made.index(None)]
        assert "Window still has an open session of" in str(refused.errors["station"])
        TrainingSession.everywhere.filter(station=station).update(state="aborted")


def test_pages_and_programs_obey(world, station, people):
    program = program_of(world, Role.PT)

    def by_page(patient: Patient) -> Callable[[], int]:
        browser = client_of(world)
        return lambda: (
            browser.post(f"/patients/{patient.pk}/new/", session_form(station)).status_code
        )

    def by_program(patient: Patient) -> Callable[[], int]:
        asked = {"patient": patient.pk, "station": station.pk, "feedback_type": "binary"}
        return lambda: program.post("/sessions", **asked)[0]

    rosa, omar = people
    for acts, answers in (
        ((by_page(rosa), by_page(omar)), [{302, 200}]),
        ((by_page(rosa), by_program(omar)), [{302, 409}, {200, 201}]),
        ((by_program(rosa), by_program(omar)), [{201, 409}]),
    ):
        assert set(at_once(*acts)) in answers
        assert open_at(station) == 1
        TrainingSession.everywhere.filter(station=station).update(state="aborted")


def test_of_two_corrections_of_the_same_form_one_is_made(world):
    session = world.session
    note = SessionCorrection.everywhere.get(session=session).new
    seen = {"initial-patient": session.patient_id, "initial-counts": "yes", "initial-note": note}
    sent = {"patient": session.patient_id, "reason": "It slipped."} | seen
    url = reverse("correct", args=[session.pk])

    def by(role: Role, **changes: str) -> Callable[[], int]:
        browser = client_of(world, role)
        given = {"counts": "yes", "note": note} | sent | changes
        return lambda: browser.post(url, given).status_code

    acts = by(Role.LEAD, counts="no"), by(Role.PT, note="Another note.")
    assert sorted(at_once(*acts)) == [200, 302]
    assert SessionCorrection.everywhere.filter(session=session).count() == 2
