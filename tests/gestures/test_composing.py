"""Gestures composed in the admin: simulated before they are stored, and drawn."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from django.test import Client

from rehab.gestures.models import ComposedGesture
from rehab.people.models import User
from rehab.people.roles import Role
from robot.motion.dry_run import validate_gesture
from robot.motion.gestures import GESTURES, ORIGINALS
from tests.support.forms import gesture_form
from tests.support.world import build_world, client_of

pytestmark = pytest.mark.django_db

WAVE: list[dict[str, Any]] = [{"turn_deg": 30}, {"turn_deg": -60, "hold_s": 0.5}, {"turn_deg": 30}]
ADD = "/admin/rehab/composedgesture/add/"


def complaints(page: Any) -> list[str]:
    """Return the errors that the page shows."""
    lists = re.findall(r'<ul class="errorlist.*?</ul>', page.content.decode(), re.DOTALL)
    return [text for one in lists for text in re.findall(r"<li>(.*?)</li>", one)]


def test_a_pt_composes_a_gesture_for_the_clinic(pt, world):
    answer = pt.post(ADD, gesture_form("wave", [*WAVE, {}, {}]))  # rows left as they came are none
    assert answer.status_code == 302
    wave = ComposedGesture.everywhere.get(name="wave")
    assert wave.clinic == world.clinic
    rows = list(wave.steps.values_list("position", "turn_deg", "hold_s"))
    assert rows == [(1, 30, 0), (2, -60, 0.5), (3, 30, 0)]
    assert validate_gesture(wave.to_data()).name == "wave"


def test_numbers_say_the_order(pt):
    steps = [WAVE[1] | {"position": 20}, WAVE[0] | {"position": 10}, WAVE[2]]
    pt.post(ADD, gesture_form("wave", steps))
    wave = ComposedGesture.everywhere.get(name="wave")
    assert [move.hold_s for move in wave.to_moves()] == [0, 0.5, 0]
    assert list(wave.steps.values_list("position", flat=True)) == [10, 20, 21]


@pytest.mark.parametrize(
    ("steps", "cure"),
    [
        (
            [{"forward_m": 0.52}, {"forward_m": -0.52}],
            "Step 1 goes 0.52 m away from home, further than 0.25 m. Make it shorter.",
        ),
        (
            [*WAVE[:2], {"turn_deg": 30, "within_s": 0.3}],
            "Step 3 needs 1.3 s. Give it as long, or leave its time empty.",
        ),
        ([], "A gesture has 1 to 16 steps."),
    ],
)
def test_what_no_robot_plays_is_refused_with_the_cure(pt, world, steps, cure):
    page = pt.post(ADD, gesture_form("wave", steps))
    assert page.status_code == 200
    (complaint,) = complaints(page)
    assert complaint.startswith(cure)
    assert not ComposedGesture.everywhere.filter(name="wave").exists()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("celebrate", "Every robot knows celebrate already. Choose another name."),
        ("!?", "Give a name with letters or digits."),
        ("", "This field is required."),
    ],
)
def test_names_are_short_and_the_clinic_s_own(pt, name, words):
    page = pt.post(ADD, gesture_form(name, WAVE))
    assert [text for text in complaints(page) if words in text]


def test_two_clinics_may_use_a_name_but_none_twice(pt):
    ComposedGesture.everywhere.create(clinic=build_world("birch").clinic, name="wave")
    assert pt.post(ADD, gesture_form("wave", WAVE)).status_code == 302
    page = pt.post(ADD, gesture_form("wave", WAVE))
    assert page.status_code == 200
    assert ComposedGesture.everywhere.filter(name="wave").count() == 2


def test_a_name_is_written_as_people_write(pt):
    assert pt.post(ADD, gesture_form("Slow wave", WAVE)).status_code == 302
    assert ComposedGesture.everywhere.get(name="slow-wave").to_data()["name"] == "slow-wave"


def simulate(pt: Client, steps: Any, **tracks: str) -> dict[str, Any]:
    """Return what the floor of the form is told of steps, lights and notes."""
    answer = pt.get("/admin/rehab/composedgesture/preview/", {"steps": json.dumps(steps)} | tracks)
    told: dict[str, Any] = answer.json()
    return told


def test_the_floor_is_told_what_steps_would_do(pt):
    usual = {"turn_deg": 0, "forward_m": 0, "hold_s": 0, "pace": 1, "within_s": None}
    out, back = usual | {"forward_m": 0.12}, usual | {"forward_m": -0.12}
    told = simulate(pt, [out, *(usual | step for step in WAVE), back])
    assert told["words"].startswith("Takes ")
    assert "up to 0.12 m from home" in told["words"]
    assert max(x_m for _at, x_m, _y, _heading in told["preview"]["poses"]) == pytest.approx(
        0.12, 0.1
    )
    assert "button" in json.dumps(simulate(pt, [out, back], notes="1 button")["preview"])
    assert "Line 1" in simulate(pt, [out, back], lights="green")["problem"]
    assert simulate(pt, [out]) == {
        "problem": "It ends 12 cm from home. Add steps that lead back home."
    }
    refused: list[Any] = [[], [{}], [1], {"a": 1}, [usual | {"turn_deg": "x"}]]
    for broken in refused:
        assert simulate(pt, broken)["problem"]


def test_the_floor_writes_numbers_as_the_page_does(world):
    User.everywhere.filter(pk=world.people[Role.PT].pk).update(language="es")
    usual = {"turn_deg": 0, "hold_s": 0, "pace": 1, "within_s": None}
    there_and_back = [usual | {"forward_m": way} for way in (0.12, -0.12)]
    assert "0,12 m" in simulate(client_of(world, Role.PT), there_and_back)["words"]


def test_the_list_shows_those_that_every_robot_knows(pt):
    page = pt.get("/admin/rehab/composedgesture/").content.decode()
    assert page.count("data-preview=") == len(GESTURES) + len(ORIGINALS) == 7
    assert "Celebrate: a step ahead and a wiggle" in page


def test_a_change_is_simulated_as_a_whole(pt):
    pt.post(ADD, gesture_form("wave", WAVE))
    wave = ComposedGesture.everywhere.get(name="wave")
    stored = [
        step | {"id": row.pk, "gesture": wave.pk, "position": row.position}
        for step, row in zip(WAVE, wave.steps.all(), strict=True)
    ]
    stored[2] |= {"DELETE": "on"}
    url = f"/admin/rehab/composedgesture/{wave.pk}/change/"
    page = pt.post(url, gesture_form("wave", stored, stored=3))
    assert "It ends turned by 30° to the right" in complaints(page)[0]
    page = pt.post(url, gesture_form("wave", [*stored, {"turn_deg": 30}], stored=3))
    assert page.status_code == 302
    assert list(wave.steps.values_list("position", flat=True)) == [1, 2, 3]


def test_one_that_is_no_gesture_any_more_says_so(pt, world):
    """Limits may change with a release; what is stored is then refused."""
    broken = ComposedGesture.everywhere.create(clinic=world.clinic, name="broken")
    broken.steps.create(position=1, forward_m=0.2)
    assert "It ends 20 cm from home" in pt.get("/admin/rehab/composedgesture/").content.decode()


def test_lights_and_notes_are_written_a_line_each_and_played(pt):
    tracks = {"lights": "0 orange\n\n 0.5 green green ", "notes": "0 440 0.1\n1.0 button"}
    assert pt.post(ADD, gesture_form("wave", WAVE) | tracks).status_code == 302
    wave = ComposedGesture.everywhere.get(name="wave")
    score = validate_gesture(wave.to_data()).score
    assert [(one.at_s, one.first, one.second) for one in score.lights] == [
        *((0, "orange", "off"), (0.5, "green", "green"))
    ]
    assert [(one.at_s, one.frequency_hz, one.melody) for one in score.notes] == [
        *((0, 440, None), (1, 0, "button"))
    ]


@pytest.mark.parametrize(
    ("tracks", "cure"),
    [
        ({"lights": "green"}, "Line 1 is not written like “0.5 green off”."),
        ({"lights": "0 green\n0.5 green off off"}, "Line 2 is not written like “0.5 green off”."),
        ({"lights": "0.5 red"}, "Light 1 is off, green or orange; red says that the robot"),
        ({"notes": "0.5"}, "Line 1 is not written like “0.5 440 0.2”."),
        ({"notes": "0.5 440 loud"}, "Line 1 is not written like “0.5 440 0.2”."),
        ({"notes": "0.5 tune"}, "Note 1 has no such melody."),
    ],
)
def test_tracks_that_no_robot_plays_are_refused_with_the_cure(pt, tracks, cure):
    answer = pt.post(ADD, gesture_form("wave", WAVE) | tracks)
    assert any(cure in one for one in complaints(answer)), complaints(answer)
    assert not ComposedGesture.everywhere.filter(name="wave").exists()
