"""How a session is set up: nothing to type, and whatever cannot be walked is refused in words."""

from __future__ import annotations

import re

import pytest

from rehab.gestures.models import ComposedGesture
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import change_session
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.stations.models import Device, Station
from rehab.training.changes import ChangeKind
from rehab.training.measures import MEASURES, InvalidSetting
from rehab.training.robot_cueing import CueTiming
from rehab.training.schedules import Schedule, ScheduleKind
from rehab.training.valences import CueGestures
from robot.motion.composed_gestures import parse_gesture
from robot.motion.pose import HOME
from robot.wire.cue_limits import CueRule
from tests.support.page_text import plain
from tests.support.tablets import approved
from tests.support.walks import make_patient, make_session
from tests.support.world import NOW, World, build_world

pytestmark = pytest.mark.django_db


@pytest.fixture
def patient(world: World) -> Patient:
    return make_patient(world.clinic, code="K7-204")


@pytest.fixture
def station(world: World) -> Station:
    return Station.everywhere.create(clinic=world.clinic, name="Free")


def choices(place: Station, protocol: str = "Training only", **others: object) -> dict[str, object]:
    rule = Protocol.everywhere.get(name=protocol, clinic=None)
    return {
        "valence": "negative",
        "goal_by": "value",
        "goal_value": "4.05",
        "goal_percent": "110",
        "wanted_hits": "65",
        "minutes": "12",
        "protocol": rule.pk,
        "station": place.pk,
        "source": "live",
        "trained_side": "right",
        "robot": "gentle",
        "robot_above": "(usual)",
        "robot_below": "(usual)",
        **others,
    }


def a_pulse(world) -> MeasureDefinition:
    return MeasureDefinition.everywhere.create(
        clinic=world.clinic, slug="pulse", name="heart rate", unit="1/min", channel="heart_rate",
        value_min=30, value_max=220, goal_min=40, goal_max=200, first_goal=110,
    )  # fmt: skip


def newest() -> TrainingSession:
    return TrainingSession.everywhere.order_by("pk").last()


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
    assert "still has an open session of Rosa (K7-204)" in page
    assert newest() == walking
    change_session(walking, ChangeKind.ABORT)
    pt.post(f"/patients/{other.pk}/new/", choices(station))
    assert newest().patient == other


@pytest.mark.django_db(transaction=True)  # the writer has its own connection
def test_like_last_time_offers_what_the_last_session_was(pt, patient, station):
    answers = {
        "robot_threshold": "80",
        "robot_answers": "streaks",
        "robot_count": "4",
        "robot_rest": "20",
        "schedule": "faded",
        "schedule_steps": "3",
        "goal_follows": "automatic",
    }
    pt.post(f"/patients/{patient.pk}/new/", choices(station, source="synthetic poor", **answers))
    session = newest()
    plan = session.to_plan()
    assert (plan.activation_threshold, plan.adaptation.mode) == (0.8, "automatic")
    assert plan.cue_timing == CueTiming(CueRule.STREAKS, count=4, rest_s=20)
    assert plan.schedule == Schedule(ScheduleKind.FADED, 3)
    assert session.source_args[:3] == ["synthetic", "--profile", "poor"]
    assert session.simulated
    change_session(session, ChangeKind.START)
    change_session(session, ChangeKind.GOAL, 4.2)
    change_session(session, ChangeKind.ROBOT_INTENSITY, 0.0)
    change_session(session, ChangeKind.ACTIVATION_THRESHOLD, 0.7)
    change_session(session, ChangeKind.GOAL_ADAPTATION, "off")
    change_session(session, ChangeKind.FINISH)
    page = pt.get(f"/patients/{patient.pk}/")
    last = page.context["last"]
    assert (last["valence"], last["goal_value"], last["source"]) == (
        "negative",
        4.2,
        "live",  # one trial with a simulator makes nobody a simulated patient
    )
    assert "Like last time" in page.content.decode()
    offered = plain(pt.get(f"/patients/{patient.pk}/new/").content.decode())
    assert "Last time ended at 4.20 W/kg." in offered
    assert "Begin with 4.20 W/kg" in offered
    chosen = {field.name: field.value() for field in page.context["form"]}
    hidden = {name: "" if value is None else value for name, value in chosen.items()}
    pt.post(f"/patients/{patient.pk}/new/", hidden)
    again = newest()
    assert again.pk != session.pk
    assert again.to_plan().goal.value == 4.2
    assert again.to_plan().robot_intensity == 0
    assert again.to_plan().activation_threshold == 0.7
    assert again.to_plan().adaptation.mode == "off"
    varied = ("goal", "robot_intensity", "activation_threshold", "adaptation", "seed")
    alike = dict.fromkeys(varied)
    assert again.plan | alike == session.plan | alike


def compose(world: World, name: str = "wave") -> ComposedGesture:
    gesture = ComposedGesture.everywhere.create(clinic=world.clinic, name=name)
    for position, degrees in enumerate((30, -60, 30), start=1):
        gesture.steps.create(position=position, turn_deg=degrees)
    return gesture


def test_a_composed_gesture_goes_along_with_the_plan(pt, patient, station, world):
    gesture = compose(world)
    url = f"/patients/{patient.pk}/new/"
    assert "wave" in pt.get(url).content.decode()
    pt.post(url, choices(station, robot_above="wave", robot_below="(nothing)"))
    plan = newest().to_plan()
    assert plan.valence.cue == CueGestures("wave", None)
    assert [data["name"] for data in plan.gestures] == ["wave"]
    assert parse_gesture(plan.gestures[0]).waypoints[-1].pose == HOME
    TrainingSession.everywhere.filter(pk=newest().pk).update(state="finished")
    form = pt.get(url).context["form"]
    assert (form["robot_above"].value(), form["robot_below"].value()) == ("wave", "(nothing)")
    gesture.delete()  # the next set-up does without it; the session has kept its own
    form = pt.get(url).context["form"]
    assert (form["robot_above"].value(), form["robot_below"].value()) == ("(usual)", "(nothing)")
    assert newest().to_plan().gestures == plan.gestures


def test_a_gesture_that_no_robot_plays_is_refused_in_words(pt, patient, station, world):
    compose(world).steps.filter(position=3).delete()
    page = pt.post(f"/patients/{patient.pk}/new/", choices(station, robot_above="wave"))
    assert "Gesture wave: It ends turned by 30° to the right" in page.content.decode()


def test_a_gesture_of_another_clinic_cannot_be_chosen(pt, patient, station, world):
    compose(build_world("birch"))
    page = pt.post(f"/patients/{patient.pk}/new/", choices(station, robot_above="wave"))
    assert "Select a valid choice" in page.content.decode()
    with pytest.raises(InvalidSetting, match="no gesture wave"):
        make_session(patient, cue=CueGestures(above="wave"))


def test_recordings_of_this_machine_can_be_chosen_and_are_looked_at(
    pt, patient, station, settings, tmp_path
):
    settings.DATA_DIR = tmp_path
    folder = tmp_path / "recordings"
    folder.mkdir()
    (folder / "broken.csv").write_text("not,a\nwalk,at all\n")
    url = f"/patients/{patient.pk}/new/"
    page = pt.post(url, choices(station, source="recording broken.csv")).content.decode()
    assert "broken.csv" in page
    assert "layouts" in page.lower()
    (folder / "walk.csv").write_text("time_s,side,value\n1.0,left,4.0\n2.1,left,3.9\n")
    pt.post(url, choices(station, source="recording walk.csv"))
    assert newest().source_args == ["recording", str(folder / "walk.csv")]
    settings.HOSTED = True  # there a folder would belong to no clinic
    assert "walk.csv" not in pt.get(url).content.decode()


def test_recorded_signals_can_be_chosen_once_the_body_mass_is_known(
    pt, patient, station, tmp_path, settings
):
    settings.DATA_DIR = tmp_path
    file = tmp_path / "recordings" / "lab.csv"
    file.parent.mkdir()
    file.write_text("time_s,left_force_n,left_moment_nm,left_angle_rad\n0,0,0,0\n")
    url = f"/patients/{patient.pk}/new/"
    signals = choices(station, source="recording lab.csv")
    assert "give Rosa&#x27;s body mass first" in pt.post(url, signals).content.decode()
    assert TrainingSession.everywhere.count() == 1  # the world's own
    details = {"nickname": "Rosa", "code": "K7-204", "paretic_side": "left", "body_mass_kg": "71.5"}
    answer = pt.post(f"/patients/{patient.pk}/details/", details)
    assert answer.url == f"/patients/{patient.pk}/"
    pt.post(url, signals)
    assert newest().source_args == ["recording", str(file), "--mass", "71.5"]


def test_a_protocol_that_ends_by_itself_says_how_long_it_takes(pt, patient, station):
    page = pt.get(f"/patients/{patient.pk}/new/")
    assert page.context["form"]["minutes"].value() == 13  # 54 strides, 600 s and 120 s
    by_name = {row.name: row.pk for row in Protocol.everywhere.filter(clinic=None)}
    targets = page.context["targets"]
    assert targets[by_name["Training only"]] == {"minutes": None, "wanted_hits": None}
    assert targets[by_name["Baseline, training, washout"]]["minutes"] == 13
    assert targets[by_name["Ten minutes at 60 %"]] == {"minutes": 10, "wanted_hits": 60}


def test_the_page_says_what_each_protocol_has_and_how_long_it_takes(pt, patient):
    page = plain(pt.get(f"/patients/{patient.pk}/new/").content.decode())
    assert "Baseline 59 s · Training 10 min · Washout 2 min" in page
    assert "Training until you move on" in page
    assert "open end" in page
    lab = re.search(r"<span>Thirty minutes with catch blocks</span>.*?</svg>", page, re.DOTALL)[0]
    assert "15 phases" in lab
    assert lab.count("<rect") == 15
    assert lab.count('class="with"') == 7


def test_a_person_is_offered_simulated_steps_only_behind_a_try(pt, patient):
    tried = re.compile(r'<details class="try" (open)?>.*?</details>', re.DOTALL)
    page = pt.get(f"/patients/{patient.pk}/new/").content.decode()
    assert tried.search(page)[1] is None
    assert 'value="synthetic demo"' in tried.search(page)[0]
    assert 'value="synthetic' not in tried.sub("", page)
    patient.simulated = True
    patient.save()
    page = pt.get(f"/patients/{patient.pk}/new/").content.decode()
    assert not tried.search(page)
    assert 'value="synthetic demo"' in page


def test_simulated_steps_that_were_chosen_are_seen_where_something_else_is_refused(
    pt, patient, station
):
    wrong = choices(station, source="synthetic demo", wanted_hits="0")
    page = pt.post(f"/patients/{patient.pk}/new/", wrong).content.decode()
    assert '<details class="try" open>' in page


def test_who_has_not_walked_is_not_offered_what_was_last_time(pt, patient, station):
    page = pt.get(f"/patients/{patient.pk}/new/").content.decode()
    assert "Like last time" not in page
    assert "Suggested set-up" in page
    pt.post(f"/patients/{patient.pk}/new/", choices(station))
    page = pt.get(f"/patients/{patient.pk}/new/").content.decode()
    assert "Like last time" in page


def test_a_taken_station_leads_to_its_session(pt, patient, station):
    pt.post(f"/patients/{patient.pk}/new/", choices(station))
    page = pt.post(f"/patients/{patient.pk}/new/", choices(station)).content.decode()
    problem = re.search(r'<div class="wrong\b.*?</div>', page, re.DOTALL)[0]
    assert f'href="/sessions/{newest().pk}/monitor/"' in problem


def test_it_says_what_ends_a_walk(pt, patient):
    page = pt.get(f"/patients/{patient.pk}/new/")
    ends = {str(row): page.context["ends"][row.pk] for row in Protocol.everywhere.all()}
    assert ends["Training only"] == "You end the walk; the minutes are your plan."
    told = "The protocol ends the walk: 10 min of training, 13 min in all."
    assert ends["Baseline, training, washout"].replace("\N{NO-BREAK SPACE}", " ") == told


def test_one_open_session_alone_is_shown_on_its_own_page(pt, patient):
    session = make_session(patient)
    page = pt.get(f"/sessions/two/?of={session.pk}", follow=True)
    assert page.redirect_chain[0][0] == f"/sessions/{session.pk}/monitor/?second=none"
    assert "Start a second walk" in page.content.decode()
    alone = pt.get(f"/sessions/{session.pk}/monitor/").content.decode()
    assert "Start a second walk" not in alone
