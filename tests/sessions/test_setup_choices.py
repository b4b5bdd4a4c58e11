"""What a set-up offers: what was last time, protocols, sources and gestures."""

from __future__ import annotations

import re

import pytest

from rehab.gestures.models import ComposedGesture
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import change_session
from rehab.sessions.setup.protocol_models import Protocol
from rehab.training.changes import ChangeKind
from rehab.training.measures import InvalidSetting
from rehab.training.robot_cueing import CueTiming
from rehab.training.schedules import Schedule, ScheduleKind
from rehab.training.valences import CueGestures
from robot.motion.composed_gestures import parse_gesture
from robot.motion.pose import HOME
from robot.wire.cue_limits import CueRule
from tests.support.page_text import plain
from tests.support.setup_form import choices, newest
from tests.support.walks import make_session
from tests.support.world import World, build_world

pytestmark = pytest.mark.django_db


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


def test_it_says_what_ends_a_walk(pt, patient):
    page = pt.get(f"/patients/{patient.pk}/new/")
    ends = {str(row): page.context["ends"][row.pk] for row in Protocol.everywhere.all()}
    assert ends["Training only"] == "You end the walk; the minutes are your plan."
    told = "The protocol ends the walk: 10 min of training, 13 min in all."
    assert ends["Baseline, training, washout"].replace("\N{NO-BREAK SPACE}", " ") == told


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
