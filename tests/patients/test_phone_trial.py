"""A trial of a phone: a session of the demo patient, and the screens that it needs."""

from __future__ import annotations

from urllib.parse import quote

import numpy as np
import pytest
from django.test import Client

from rehab.patients.phone_trial import BASELINE_STRIDES, GOAL_PERCENT
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.forms.initial import initial_choices
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import change_session
from rehab.stations.builtin import first_station
from rehab.training.changes import ChangeKind
from tests.support.walks import make_patient, make_session
from tests.support.world import World, build_world
from tests.support.worn_sensors import measure, stroke_walks

pytestmark = pytest.mark.django_db

TRIAL = "/first-steps/phone/"


def begin(pt: Client, side: str = "left") -> TrainingSession:
    assert pt.post(TRIAL, {"side": side}).headers["Location"] == TRIAL
    return TrainingSession.everywhere.filter(patient__code="demo").order_by("pk").last()


def test_its_goal_lies_just_below_the_mean_of_a_short_baseline(pt, world: World, settings):
    plan = begin(pt).to_plan()
    assert [phase.kind for phase in plan.phases] == ["baseline", "training"]
    assert plan.goal.percent_of_baseline == 98
    assert plan.goal.baseline_strides <= plan.phases[0].strides <= 10
    settings.HOST, settings.ALLOWED_HOSTS = "127.0.0.1", ["127.0.0.1"]
    page = pt.get(TRIAL, headers={"host": "127.0.0.1:8000"}).content.decode()
    assert "More is better" in page
    assert "No screen shows Demo" in page
    assert "not connected" in page
    assert f'action="/https/?next={quote(TRIAL, safe="")}"' in page


@pytest.mark.django_db(transaction=True)  # the writer has its own connection
def test_a_second_tap_leads_to_the_same_trial_and_the_other_leg_to_a_new_one(pt, world: World):
    first = begin(pt)
    assert begin(pt) == first
    other = begin(pt, "right")
    first.refresh_from_db()
    assert (first.state, other.trained_side) == ("aborted", "right")
    change_session(other, ChangeKind.START)
    answer = pt.post(TRIAL, {"side": "left"}, follow=True)  # what walks is not ended
    assert "still has an open session" in answer.content.decode()
    other.refresh_from_db()
    assert other.state == "running"


@pytest.mark.django_db(transaction=True)  # the writer has its own connection
def test_opening_it_again_keeps_the_leg(pt, world: World):
    def reopen() -> TrainingSession:
        assert pt.post(TRIAL, {"open": ""}).headers["Location"] == TRIAL
        return TrainingSession.everywhere.filter(patient__code="demo").order_by("pk").last()

    assert reopen().trained_side == "left"
    right = begin(pt, "right")
    assert reopen() == right
    assert "Try a phone: right" in pt.get(TRIAL).content.decode()
    assert Patient.everywhere.get(code="demo").paretic_side == "right"
    change_session(right, ChangeKind.ABORT)
    again = reopen()
    assert (again.trained_side, again != right) == ("right", True)


@pytest.mark.django_db(transaction=True)  # the writer has its own connection
def test_one_tap_starts_it_and_leads_to_the_therapists_page(pt, world: World):
    trial = begin(pt)
    page = pt.get(TRIAL, {"step": "start"}).content.decode()
    assert 'name="start"' in page
    there = f"/sessions/{trial.pk}/monitor/"
    for _again in range(2):
        assert pt.post(TRIAL, {"start": ""}).headers["Location"] == there
        trial.refresh_from_db()
        assert trial.state == "running"
    assert f'href="{there}"' in pt.get(TRIAL, {"step": "start"}).content.decode()


def test_a_taken_station_leads_to_its_session(pt, world: World):
    station = first_station(world.clinic)
    TrainingSession.everywhere.filter(station=station).update(state="finished")
    session = make_session(make_patient(world.clinic, code="K7-204"), station=station)
    there = pt.post(TRIAL, {"side": "left"}).headers["Location"]
    assert there == f"/sessions/{session.pk}/monitor/"


def test_a_trial_is_its_own_clinics(pt, world: World):
    begin(pt)
    assert set(pt.get(f"{TRIAL}state/").json()) == {"screen", "phone", "recording"}
    stranger = build_world("oak").pt
    assert "Which leg was recorded?" in stranger.get(TRIAL).content.decode()
    assert stranger.get(f"{TRIAL}state/").json() == {}
    assert stranger.post(f"{TRIAL}open/").headers["Location"] == TRIAL


@pytest.mark.django_db(transaction=True)  # the writer has its own connection
def test_a_trial_is_no_last_time(pt, world: World):
    trial = begin(pt)
    change_session(trial, ChangeKind.ABORT)
    page = pt.get(f"/patients/{trial.patient_id}/").content.decode()
    assert "Suggested set-up" in page
    assert "Like last time" not in page
    assert initial_choices(trial.patient, world.people[Role.PT])["source"] == "synthetic demo"


def test_first_steps_stay_on_the_start_page_until_a_patient_walks_or_they_are_hidden(pt, world):
    for rows in (Patient, TrainingSession):
        rows.everywhere.filter(clinic=world.clinic).update(simulated=True)
    steps = "First steps, one by one"
    assert steps in pt.get("/start/").content.decode()
    begin(pt)
    assert steps in pt.get("/start/").content.decode()
    assert pt.post("/first-steps/", {"hide": ""}).headers["Location"] == "/start/"
    assert steps not in pt.get("/start/").content.decode()


def test_a_clinic_whose_patients_walk_is_shown_no_first_steps(pt, world: World):
    session = make_session(make_patient(world.clinic, code="K7-205"))
    TrainingSession.everywhere.filter(pk=session.pk).update(active_s=60)
    assert "First steps, one by one" not in pt.get("/start/").content.decode()


def test_recorded_legs_reach_its_goal_about_as_often_as_is_wanted():
    """From its 20th second on a recording walks (static/js/sensor/trial.js)."""
    rates = []
    for walk in stroke_walks("pp01_003", "pp02_000", "pp06_001", "pp10_000"):
        if walk.place != "shank":
            continue
        strides = [one for one in measure(walk)[0] if one.initial_contact_s >= 20]
        shares = [one.stance_s / one.stride_s for one in strides if not one.reasons]
        goal = GOAL_PERCENT / 100 * np.mean(shares[:BASELINE_STRIDES])
        rates.append(np.mean(np.array(shares[BASELINE_STRIDES:]) >= goal))
    assert len(rates) == 8
    assert min(rates) >= 0.5  # at the mean itself: 0.05
    assert 0.6 <= np.mean(rates) <= 0.85
