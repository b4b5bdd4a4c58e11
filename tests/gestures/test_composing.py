"""Gestures composed in the admin: simulated before they are stored, and drawn."""

from __future__ import annotations

import re
from typing import Any

import pytest
from django.test import Client

from rehab.gestures.models import Gesture
from robot.motion.dry_run import validate_gesture
from tests.support.forms import gesture_form
from tests.support.world import World, build_world, client_of

pytestmark = pytest.mark.django_db

WAVE: list[dict[str, Any]] = [{"turn_deg": 30}, {"turn_deg": -60, "hold_s": 0.5}, {"turn_deg": 30}]
ADD = "/admin/rehab/gesture/add/"


@pytest.fixture
def pt(world: World) -> Client:
    return client_of(world)


def complaints(page: Any) -> list[str]:
    """Return the errors that the page shows."""
    lists = re.findall(r'<ul class="errorlist.*?</ul>', page.content.decode(), re.DOTALL)
    return [text for one in lists for text in re.findall(r"<li>(.*?)</li>", one)]


def test_a_pt_composes_a_gesture_for_the_clinic(pt, world):
    answer = pt.post(ADD, gesture_form("wave", [*WAVE, {}, {}]))  # rows left as they came are none
    assert answer.status_code == 302
    wave = Gesture.everywhere.get(name="wave")
    assert wave.clinic == world.clinic
    rows = list(wave.steps.values_list("position", "turn_deg", "hold_s"))
    assert rows == [(1, 30, 0), (2, -60, 0.5), (3, 30, 0)]
    assert validate_gesture(wave.to_data()).name == "wave"


def test_numbers_say_the_order(pt):
    steps = [WAVE[1] | {"position": 20}, WAVE[0] | {"position": 10}, WAVE[2]]
    pt.post(ADD, gesture_form("wave", steps))
    wave = Gesture.everywhere.get(name="wave")
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
            [{"forward_m": 0.1}],
            "It ends 10 cm from home. Add steps that lead back home.",
        ),
        (
            [{"forward_m": -0.1}, {"forward_m": 0.1}],
            "Step 1 backs where it did not come from; there is no bumper behind. "
            "Let it face the way, or go ahead first.",
        ),
        (
            [*WAVE[:2], {"turn_deg": 30, "within_s": 0.3}],
            "Step 3 needs 1.3 s. Give it as long, or leave its time empty.",
        ),
        (WAVE * 5, "This takes up to"),
        ([{"turn_deg": 30, "pace": 3}], "Step 1 has a pace outside 0.2 to 1."),
        ([], "A gesture has 1 to 16 steps."),
    ],
)
def test_what_no_robot_plays_is_refused_with_the_cure(pt, world, steps, cure):
    page = pt.post(ADD, gesture_form("wave", steps))
    assert page.status_code == 200
    (complaint,) = complaints(page)
    assert complaint.startswith(cure)
    assert not Gesture.everywhere.filter(name="wave").exists()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("celebrate", "Every robot knows celebrate already. Choose another name."),
        ("original_binary", "Every robot knows original_binary already."),
        ("two words", "valid “slug”"),
        ("", "This field is required."),
    ],
)
def test_names_are_short_and_the_clinic_s_own(pt, name, words):
    page = pt.post(ADD, gesture_form(name, WAVE))
    assert [text for text in complaints(page) if words in text]


def test_two_clinics_may_use_a_name_but_none_twice(pt):
    Gesture.everywhere.create(clinic=build_world("birch").clinic, name="wave")
    assert pt.post(ADD, gesture_form("wave", WAVE)).status_code == 302
    page = pt.post(ADD, gesture_form("wave", WAVE))
    assert page.status_code == 200
    assert Gesture.everywhere.filter(name="wave").count() == 2


def test_a_stored_gesture_is_drawn_without_styles_or_scripts(pt):
    pt.post(ADD, gesture_form("wave", [{"forward_m": 0.12}, *WAVE, {"forward_m": -0.12}]))
    wave = Gesture.everywhere.get(name="wave")
    page = pt.get(f"/admin/rehab/gesture/{wave.pk}/change/").content.decode()
    drawing = re.search(r"<svg xmlns.*?</svg>", page, re.DOTALL)[0]
    assert 'aria-label="Takes' in drawing
    assert "up to 0.12 m from home" in drawing
    assert re.findall(r">([\d, ]+)</text>", drawing) == ["1, 4", "2", "3", "5"]
    assert "style=" not in drawing
    assert "<script" not in drawing
    assert "up to 0.12 m from home" in pt.get("/admin/rehab/gesture/").content.decode()


def test_a_change_is_simulated_as_a_whole(pt):
    pt.post(ADD, gesture_form("wave", WAVE))
    wave = Gesture.everywhere.get(name="wave")
    stored = [
        step | {"id": row.pk, "gesture": wave.pk, "position": row.position}
        for step, row in zip(WAVE, wave.steps.all(), strict=True)
    ]
    stored[2] |= {"DELETE": "on"}
    url = f"/admin/rehab/gesture/{wave.pk}/change/"
    page = pt.post(url, gesture_form("wave", stored, stored=3))
    assert "It ends turned by 30° to the right" in complaints(page)[0]
    page = pt.post(url, gesture_form("wave", [*stored, {"turn_deg": 30}], stored=3))
    assert page.status_code == 302
    assert list(wave.steps.values_list("position", flat=True)) == [1, 2, 3]


def test_one_that_is_no_gesture_any_more_says_so(pt, world):
    """Limits may change with a release; what is stored is then refused, not drawn."""
    broken = Gesture.everywhere.create(clinic=world.clinic, name="broken")
    broken.steps.create(position=1, forward_m=0.2)
    for url in (f"/admin/rehab/gesture/{broken.pk}/change/", "/admin/rehab/gesture/"):
        assert "It ends 20 cm from home" in pt.get(url).content.decode()
