"""Set-up options: one entry of the registry is all that a new one needs."""

from __future__ import annotations

import re
import sys
from importlib.util import find_spec, module_from_spec
from typing import Any
from unittest import mock

import pytest

from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.sessions.forms.initial import initial_choices
from rehab.sessions.models import TrainingSession
from rehab.sessions.schemas import SessionRequestBody, session_request_body
from rehab.sessions.setup.option import Group, Option, OptionColumn
from rehab.sessions.setup.options import OPTIONS, build_parts, exported_options, preset_options
from rehab.sessions.setup.presets import Preset
from rehab.training.measures import InvalidSetting
from tests.support.walks import make_patient
from tests.support.world import World, client_of

pytestmark = pytest.mark.django_db

# The schedule's rule has had this part all along; only nobody could choose it.
STAGE = Option(
    name="schedule_stage",
    label="Steps until it becomes rarer",
    help="Of `faded`: steps after which feedback becomes rarer.",
    kind=int,
    default=50,
    least=1,
    most=1000,
    place="schedule.stage",
    group=Group.FEEDBACK,
    applies_to=("schedule", ("faded",)),
    column=OptionColumn("schedule_stage", "steps", "Steps after which it became rarer."),
)


@pytest.fixture
def stage(monkeypatch: pytest.MonkeyPatch) -> Option:
    monkeypatch.setitem(OPTIONS, STAGE.name, STAGE)
    return STAGE


@pytest.fixture
def rosa(world: World) -> Patient:
    return make_patient(world.clinic, code="K7-204")


def sent(patient: Patient, by: User, **others: Any) -> dict[str, str]:
    """Return the set-up as its page sends it, with the initial values."""
    values = initial_choices(patient, by) | others
    return {
        name: str(getattr(value, "pk", value))
        for name, value in values.items()
        if value not in (None, False)
    }


def codebook_of_today() -> list[tuple[Any, ...]]:
    """Return the codebook of exports that a server would have that starts now."""
    fresh: dict[str, Any] = {}
    for name in ("rehab.exports.session_table", "rehab.exports.codebook"):
        spec = find_spec(name)
        assert spec is not None
        assert spec.loader is not None
        with mock.patch.dict(sys.modules, fresh):
            fresh[name] = module_from_spec(spec)
            spec.loader.exec_module(fresh[name])
    return list(fresh["rehab.exports.codebook"].codebook_rows())


def test_a_new_option_is_one_entry(stage: Option, world: World, rosa: Patient) -> None:
    client, url = client_of(world), f"/patients/{rosa.pk}/new/"
    user = world.people[Role.PT]

    page = client.get(url).content.decode()  # the form
    field = re.search(r'<label[^>]*data-of="schedule"\s+data-is="faded"[^>]*>.*?</label>', page)
    assert field
    assert str(stage.label) in field[0]
    assert re.search(r'name="schedule_stage" value="50"', field[0])
    chosen = sent(rosa, user, schedule="faded", schedule_steps=5, schedule_stage=20)
    refused = sent(rosa, user, schedule_stage=2000)
    assert "Give 1 to 1000." in client.post(url, refused).content.decode()

    client.post(url, chosen)  # the plan, and what the next set-up offers
    session = TrainingSession.everywhere.get(patient=rosa)
    assert session.to_plan().schedule.stage == 20
    assert initial_choices(rosa, user)["schedule_stage"] == 20

    chosen |= {"then": "preset", "preset_name": "Rarer"}  # a preset, and its page in the admin
    client.post(url, chosen)
    preset = Preset.everywhere.get(name="Rarer")
    assert preset.options["schedule_stage"] == 20
    assert preset.to_initial(user)["schedule_stage"] == 20
    admin = client.get(f"/admin/rehab/preset/{preset.pk}/change/").content.decode()
    assert re.search(r'name="schedule_stage" value="20"', admin)
    reader = client_of(world, Role.RESEARCHER)
    admin = reader.get(f"/admin/rehab/preset/{preset.pk}/change/").content.decode()
    assert "Steps until it becomes rarer: 20" in admin

    body: Any = session_request_body()  # the API
    described = body.model_json_schema()["properties"]["schedule_stage"]
    assert described["description"] == f"{stage.help} 1 to 1000."
    assert body(patient=1, schedule_stage=20).model_dump(exclude_unset=True) == {
        "patient": 1,
        "schedule_stage": 20,
    }

    assert (stage, stage.column) in exported_options()  # exports and their codebook
    assert stage.get(session.to_plan()) == 20
    (line,) = [row for row in codebook_of_today() if row[1] == "schedule_stage"]
    assert line[:5] == ("sessions.csv", *(stage.column or ()), "integer")


def test_what_no_preset_knew_yet_is_as_usual(stage: Option, world: World) -> None:
    preset = world.rows[Preset]
    assert "schedule_stage" not in preset.options
    assert preset.values["schedule_stage"] == 50
    preset.options["left_since"] = 1
    assert "left_since" not in preset.values


@pytest.mark.parametrize("option", OPTIONS.values(), ids=list(OPTIONS))
def test_each_option_is_described_everywhere(option: Option) -> None:
    properties = SessionRequestBody.model_json_schema()["properties"]
    assert option.help.endswith((".", "…"))
    if option.name != "goal_by":
        assert properties[option.api_name or option.name]["description"].startswith(option.help)
    if not (option.place or option.is_of_patient):
        assert option.name == "source"


def test_what_is_offered_makes_a_plan_and_is_read_from_it() -> None:
    offered = {option.name: option.default for option in OPTIONS.values()}
    parts = build_parts(offered | {"robot": "gentle", "wanted_hits": 65, "minutes": 12})
    assert (parts["goal"].value, parts["goal"].percent_of_baseline) == (None, 100)
    assert (parts["target"].hit_rate, parts["target"].duration_s) == (0.65, 720)
    assert parts["robot_intensity"] == 0.5
    assert parts["walking"].belt_speed_m_s is None
    with pytest.raises(InvalidSetting, match="at least 2 steps"):
        build_parts({"schedule": "summary", "schedule_steps": 1})
    assert {option.name for option in preset_options()} == OPTIONS.keys() - {
        "device",
        "belt_speed",
        "weight_support",
        "heart_rate_limit",
    }
