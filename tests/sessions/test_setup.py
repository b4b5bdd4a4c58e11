"""How a session is set up: nothing to type, and whatever cannot be walked is refused in words."""

from __future__ import annotations

import re

import pytest

from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import change_session
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.stations.models import Device, Station
from rehab.training.changes import ChangeKind
from rehab.training.measures import MEASURES
from rehab.training.valences import CueGestures
from tests.support.setup_form import choices, newest
from tests.support.tablets import approved
from tests.support.walks import make_session
from tests.support.world import NOW, build_world

pytestmark = pytest.mark.django_db


def a_pulse(world) -> MeasureDefinition:
    return MeasureDefinition.everywhere.create(
        clinic=world.clinic, slug="pulse", name="heart rate", unit="1/min", channel="heart_rate",
        value_min=30, value_max=220, goal_min=40, goal_max=200, first_goal=110,
    )  # fmt: skip


def test_every_choice_reaches_the_plan(pt, patient, station, world):
    answer = pt.post(f"/patients/{patient.pk}/new/", choices(station))
    session = newest()
    assert answer.headers["Location"] == f"/sessions/{session.pk}/"
    plan = session.to_plan()
    assert (session.patient, session.station, session.created_by) == (
        patient,
        station,
        world.people[Role.PT],
    )
    assert (plan.valence.slug, plan.goal.value, plan.trained_side) == ("negative", 4.05, "right")
    assert (plan.target.hit_rate, plan.target.duration_s) == (0.65, 720)
    assert [phase.kind for phase in plan.phases] == ["training"]
    assert (plan.robot_intensity, plan.valence.cue, plan.gestures) == (
        0.5,
        CueGestures(None, "droop"),
        (),
    )
    assert (session.source_args, session.simulated) == ([], False)


def test_the_therapist_may_go_on_at_the_own_page(pt, patient, station):
    answer = pt.post(f"/patients/{patient.pk}/new/", choices(station, then="monitor"))
    assert answer.headers["Location"] == f"/sessions/{newest().pk}/monitor/"


def test_start_leads_to_the_therapists_page_where_a_tablet_shows_the_patients(pt, patient, station):
    """Without one, both pages are offered by name."""
    url, page = f"/patients/{patient.pk}/new/", f"/patients/{patient.pk}/"
    tablets = Device.everywhere.filter(station=station, kind=Device.Kind.TABLET)
    tablets.update(revoked_at=NOW)
    offered = pt.get(page).content.decode()
    assert "No tablet is paired with" in offered
    assert 'value="walk"' in offered
    assert 'value="monitor"' in offered
    assert pt.post(url, choices(station)).headers["Location"] == f"/sessions/{newest().pk}/"
    TrainingSession.everywhere.update(state="finished")
    approved(station, "tablet")
    offered = pt.get(page).content.decode()
    assert 'value="walk"' not in offered
    assert 'value="monitor"' in offered
    answer = pt.post(url, choices(station))
    assert answer.headers["Location"] == f"/sessions/{newest().pk}/monitor/"


def test_a_goal_in_percent_waits_for_its_baseline(pt, patient, station):
    url = f"/patients/{patient.pk}/new/"
    page = pt.post(url, choices(station, goal_by="percent"))
    assert page.status_code == 200
    assert "needs a baseline phase" in page.content.decode()
    pt.post(url, choices(station, "Baseline, training, washout", goal_by="percent"))
    assert newest().to_plan().goal.percent_of_baseline == 110
    assert newest().goal is None


@pytest.mark.parametrize("slug", [one.slug for one in MEASURES.values()])
def test_a_simulated_patient_walks_every_measure(pt, patient, station, slug):
    row = MeasureDefinition.everywhere.get(clinic=None, slug=slug)
    goal = MEASURES[slug].offered_goal
    given = choices(station, measure=row.pk, goal_value=str(goal), source="synthetic good")
    answer = pt.post(f"/patients/{patient.pk}/new/", given)
    assert answer.status_code == 302
    assert newest().measure == row
    assert newest().source_args[0] == "synthetic"


def test_any_measure_of_the_clinic_can_be_trained(pt, patient, station, world):
    pulse = a_pulse(world)
    url = f"/patients/{patient.pk}/new/"
    page = pt.get(url).content.decode()
    assert "heart rate [1/min]" in page
    assert "W/kg" in page
    chosen = choices(station, measure=pulse.pk, goal_value="112.5")
    refused = pt.post(url, chosen | {"goal_value": "3"}).content.decode()
    assert "Give one above 40 and up to 200 1/min." in refused
    assert 'data-step="0.5"' in refused
    refused = pt.post(url, chosen | {"source": "synthetic good"}).content.decode()
    assert "Simulated patients do not walk this measure" in refused
    pt.post(url, chosen)
    session = newest()
    assert session.measure == pulse
    assert session.to_plan().measure == pulse.to_rule()
    TrainingSession.everywhere.filter(pk=session.pk).update(state="aborted")
    again = pt.get(url).content.decode()  # like last time
    assert 'value="112.5"' in again
    assert re.search(r"goal\s+112.5\s+1/min", pt.get(f"/patients/{patient.pk}/").content.decode())
    birch = build_world("birch")
    other = MeasureDefinition.everywhere.get(clinic=birch.clinic)
    assert "Select a valid choice" in pt.post(url, chosen | {"measure": other.pk}).content.decode()


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("goal_value", "0", "above 0 and up to 15 W/kg"),
        ("goal_value", "16", "above 0 and up to 15 W/kg"),
        ("goal_value", "nan", "Goal, in the measure&#x27;s unit: Enter a number"),
        ("goal_value", "", "either as a value or as percent"),
        ("wanted_hits", "101", "Give 1 to 100 %"),
        ("minutes", "-1", "Give 1 to 240 minutes"),
        ("valence", "kind", "Select a valid choice"),
        ("source", "recording ../../etc/passwd", "Select a valid choice"),
        ("station", "999999", "Select a valid choice"),
        ("robot", "wild", "Select a valid choice"),
        ("robot_above", "somersault", "Select a valid choice"),
        ("robot_below", "", "After weak steps: This field is required"),
        ("robot_threshold", "0", "Give 1 to 200 %"),
        ("robot_window", "1", "Give 2 to 60 s"),
        ("robot_rest", "900", "Give 0 to 600 s"),
        ("robot_answers", "dances", "not one of the available choices"),
        ("schedule", "summary", "A summary is about at least 2 steps."),
        ("schedule_band", "80", "Give 1 to 50 %"),
        ("goal_follows", "automatic", "a target hit rate of 30 to 90 %"),
    ],
)
def test_what_cannot_be_walked_is_refused_in_words(pt, patient, station, field, value, words):
    before = TrainingSession.everywhere.count()
    extra = {"wanted_hits": "95"} if field == "goal_follows" else {}
    chosen = choices(station) | extra | {field: value}
    page = pt.post(f"/patients/{patient.pk}/new/", chosen)
    assert page.status_code == 200
    assert words in page.content.decode()
    assert TrainingSession.everywhere.count() == before


def test_a_station_or_protocol_of_another_clinic_cannot_be_chosen(pt, patient, station):
    birch = build_world("birch")
    for field, model in (("station", Station), ("protocol", Protocol)):
        page = pt.post(
            f"/patients/{patient.pk}/new/",
            choices(station) | {field: birch.rows[model].pk},
        )
        assert "Select a valid choice" in page.content.decode()


@pytest.mark.django_db(transaction=True)  # the writer has its own connection
def test_nobody_begins_where_somebody_else_may_be_walking(pt, patient, station, world):
    pt.post(f"/patients/{patient.pk}/new/", choices(station))
    walking = newest()
    other = Patient.everywhere.create(clinic=world.clinic, code="K8", nickname="Joon")
    page = pt.post(f"/patients/{other.pk}/new/", choices(station)).content.decode()
    assert "still has an open session of Rosa (B-1)" in page
    assert newest() == walking
    change_session(walking, ChangeKind.ABORT)
    pt.post(f"/patients/{other.pk}/new/", choices(station))
    assert newest().patient == other


def test_a_taken_station_leads_to_its_session(pt, patient, station):
    pt.post(f"/patients/{patient.pk}/new/", choices(station))
    page = pt.post(f"/patients/{patient.pk}/new/", choices(station)).content.decode()
    problem = re.search(r'<div class="wrong\b.*?</div>', page, re.DOTALL)[0]
    assert f'href="/sessions/{newest().pk}/monitor/"' in problem


def test_one_open_session_alone_is_shown_on_its_own_page(pt, patient):
    session = make_session(patient)
    page = pt.get(f"/sessions/two/?of={session.pk}", follow=True)
    assert page.redirect_chain[0][0] == f"/sessions/{session.pk}/monitor/?second=none"
    assert "Start a second walk" in page.content.decode()
    alone = pt.get(f"/sessions/{session.pk}/monitor/").content.decode()
    assert "Start a second walk" not in alone
