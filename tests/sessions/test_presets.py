"""Presets: one tap fills the set-up, and what stands in the set-up can be kept as one."""

from __future__ import annotations

import re
from typing import Any

import pytest
from django.core.exceptions import ValidationError

from rehab.gestures.models import ComposedGesture
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.presets import Preset
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.stations.models import Station
from tests.support.marks import mark
from tests.support.world import World, build_world, client_of

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]


@pytest.fixture
def patient(world: World) -> Patient:
    return Patient.everywhere.create(
        clinic=world.clinic, code="K7-204", nickname="Rosa", paretic_side="right"
    )


def protocol(name: str = "Baseline, training, washout") -> Protocol:
    return Protocol.everywhere.get(name=name, clinic=None)


def preset_of(world: World, *, name: str = "Challenge", **options: Any) -> Preset:
    preset = Preset(
        clinic=world.clinic,
        name=name,
        measure=MeasureDefinition.everywhere.get(clinic=None, slug="a2"),
        protocol=options.pop("protocol", None) or protocol(),
        options={
            "valence": "binary",
            "goal_by": "percent",
            "goal_value": None,
            "goal_percent": 118,
            "wanted_hits": 70,
            "minutes": 20,
            "robot": "gentle",
            "robot_above": "nod",
            "robot_below": "(nothing)",
            "robot_threshold": 80,
            "robot_answers": "streaks",
            "robot_count": 4,
            "robot_rest": 20,
            "schedule": "faded",
            "schedule_steps": 5,
            "goal_follows": "automatic",
        }
        | options,
    )
    preset.full_clean()
    preset.save()
    return preset


def filled(page: str) -> dict[str, str]:
    """Return what a set-up would send: checked choices, numbers, selected options."""
    page = page[page.index('class="set-up ') :]
    found = dict(re.findall(r'<input\s+class="num"\s+name="(\w+)"[^>]*\svalue="([^"]*)"', page))
    for tag in re.findall(r"<input\s[^>]*type=\"radio\"[^>]*>", page):
        if "checked" in tag:
            name = re.search(r'name="(\w+)"', tag)[1]
            found[name] = re.search(r'value="([^"]*)"', tag)[1]
    for tag in re.findall(r"<input type=\"text\"[^>]*inputmode=[^>]*>", page):
        given = re.search(r'value="([^"]*)"', tag)
        found[re.search(r'name="(\w+)"', tag)[1]] = given[1] if given else ""
    for name, options in re.findall(r'<select name="(\w+)"[^>]*>(.*?)</select>', page, re.DOTALL):
        found[name] = re.search(r'value="([^"]*)" selected', options)[1]
    return found


def test_one_tap_fills_the_set_up_and_leaves_person_and_place(pt, world, patient):
    station = Station.everywhere.create(clinic=world.clinic, name="Free")
    preset = preset_of(world)
    url = f"/patients/{patient.pk}/new/"
    page = pt.get(url).content.decode()
    assert f'href="?preset={preset.pk}"' in page
    chosen = filled(pt.get(f"{url}?preset={preset.pk}").content.decode())
    assert chosen == {
        "valence": "binary",
        "measure": str(preset.measure_id),
        "goal_by": "percent",
        "goal_value": "3.90",
        "goal_percent": "118",
        "wanted_hits": "70",
        "minutes": "20",
        "belt_speed": "",
        "weight_support": "",
        "heart_rate_limit": "",
        "protocol": str(preset.protocol_id),
        "robot": "gentle",
        "robot_above": "nod",
        "robot_below": "(nothing)",
        "robot_threshold": "80",
        "robot_answers": "streaks",
        "robot_window": "5.0",
        "robot_count": "4",
        "robot_rest": "20.0",
        "schedule": "faded",
        "schedule_steps": "5",
        "schedule_band": "10",
        "goal_follows": "automatic",
        "source": "live",
        "trained_side": "right",
        "station": chosen["station"],
    }
    pt.post(url, chosen | {"station": station.pk})
    session = TrainingSession.everywhere.get(patient=patient)
    plan = session.to_plan()
    assert (plan.valence.slug, plan.goal.percent_of_baseline) == ("binary", 118)
    assert (plan.target.hit_rate, plan.target.duration_s) == (0.7, 1200)
    assert (plan.robot_intensity, plan.valence.cue.above) == (0.5, "nod")
    assert plan.valence.cue.below is None


def test_a_preset_may_bring_its_source(pt, world, patient):
    preset = preset_of(world, source="synthetic good")
    page = pt.get(f"/patients/{patient.pk}/new/?preset={preset.pk}").content.decode()
    assert filled(page)["source"] == "synthetic good"


def test_a_gesture_that_is_gone_becomes_the_usual_one(pt, world, patient):
    gesture = ComposedGesture.everywhere.create(clinic=world.clinic, name="wave")
    preset = preset_of(world, robot_above="wave")
    page = f"/patients/{patient.pk}/new/?preset={preset.pk}"
    assert filled(pt.get(page).content.decode())["robot_above"] == "wave"
    gesture.delete()
    assert filled(pt.get(page).content.decode())["robot_above"] == "(usual)"


def test_another_clinics_preset_is_not_offered(pt, patient):
    birch = build_world("birch")
    foreign = birch.rows[Preset]
    page = pt.get(f"/patients/{patient.pk}/new/?preset={foreign.pk}").content.decode()
    assert mark("birch", Preset) not in page
    assert re.search(r'class="preset\b[^"]*"\s+href="/patients', page)
    assert filled(page)["valence"] == "positive"  # like last time


def choices(**others: object) -> dict[str, object]:
    return {
        "valence": "negative",
        "goal_by": "value",
        "goal_value": "4,05",
        "goal_percent": "110",
        "wanted_hits": "65",
        "minutes": "12",
        "protocol": protocol("Training only").pk,
        "source": "live",
        "robot": "off",
        "robot_above": "(usual)",
        "robot_below": "sway",
        "then": "preset",
        **others,
    }


def test_what_stands_in_the_set_up_is_kept_under_a_name(pt, world, patient):
    url = f"/patients/{patient.pk}/new/"
    answer = pt.post(url, choices(preset_name="Hard day"))
    kept = Preset.everywhere.get(clinic=world.clinic, name="Hard day")
    assert answer.headers["Location"] == f"{url}?preset={kept.pk}"
    expected = {
        "valence": "negative",
        "goal_by": "value",
        "goal_value": 4.05,
        "wanted_hits": 65,
        "minutes": 12,
        "robot": "off",
        "robot_above": "(usual)",
        "robot_below": "sway",
        "source": "live",
    }
    assert kept.options.items() >= expected.items()
    assert not TrainingSession.everywhere.filter(patient=patient).exists()
    assert "Saved as preset “Hard day”" in pt.get(answer.headers["Location"]).content.decode()


def test_without_a_name_it_says_what_it_is_and_never_the_same_twice(pt, world, patient):
    for _ in range(2):
        pt.post(f"/patients/{patient.pk}/new/", choices())
    names = Preset.everywhere.filter(options__valence="negative").values_list("name", flat=True)
    words = "Negative · 4.05\N{NO-BREAK SPACE}W/kg · 12\N{NO-BREAK SPACE}min"
    assert sorted(names) == [words, f"{words} (2)"]


def test_a_name_that_somebody_else_takes_this_moment_is_told(pt, world, patient, monkeypatch):
    find_good = Preset.full_clean

    def be_slower(preset: Preset) -> None:
        find_good(preset)
        monkeypatch.setattr(Preset, "full_clean", find_good)
        preset_of(world, name=preset.name)

    monkeypatch.setattr(Preset, "full_clean", be_slower)
    page = pt.post(f"/patients/{patient.pk}/new/", choices(preset_name="Twice"))
    assert "A preset of this name exists" in page.content.decode()
    assert Preset.everywhere.filter(name="Twice").count() == 1


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"goal_by": "percent"}, "needs a baseline phase"),
        ({"goal_value": ""}, "either as a value or as percent"),
        ({"goal_value": "16"}, "above 0 and up to 15 W/kg"),
        ({"preset_name": "Challenge"}, "A preset of this name exists"),
        ({"valence": "kind"}, "Select a valid choice"),
    ],
)
def test_what_could_not_be_walked_is_no_preset(pt, world, patient, wrong, words):
    preset_of(world)
    before = Preset.everywhere.count()
    page = pt.post(f"/patients/{patient.pk}/new/", choices(**wrong))
    assert page.status_code == 200
    assert words in page.content.decode()
    assert Preset.everywhere.count() == before


def test_the_admin_refuses_what_could_not_be_walked(pt, world):
    with pytest.raises(ValidationError, match="needs a baseline phase"):
        preset_of(world, protocol=protocol("Training only"))
    form = {
        "name": "New one",
        "valence": "positive",
        "measure": MeasureDefinition.everywhere.get(clinic=None, slug="a2").pk,
        "protocol": protocol("Training only").pk,
        "goal_by": "percent",
        "goal_percent": "100",
        "robot": "normal",
        "robot_above": "(usual)",
        "robot_below": "(usual)",
    }
    page = pt.post("/admin/rehab/preset/add/", form)
    assert "needs a baseline phase" in page.content.decode()
    saved = pt.post("/admin/rehab/preset/add/", form | {"protocol": protocol().pk})
    assert saved.status_code == 302
    assert Preset.everywhere.get(name="New one").clinic == world.clinic


def test_a_researcher_reads_presets_and_changes_none(world):
    client = client_of(world, Role.RESEARCHER)
    key = world.rows[Preset].pk
    assert client.get("/admin/rehab/preset/").status_code == 200
    assert client.get("/admin/rehab/preset/add/").status_code == 403
    assert client.post(f"/admin/rehab/preset/{key}/delete/", {"post": "yes"}).status_code == 403
