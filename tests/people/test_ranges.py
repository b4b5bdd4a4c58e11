"""Numbers out of range are refused in one sentence, with the unit that the page shows."""

from __future__ import annotations

from typing import Any

import pytest
from django import forms
from django.utils import translation

from rehab.patients.forms import PatientForm
from rehab.people.ranges import NumberField, WholeNumberField, range_message
from rehab.people.roles import Role
from rehab.sessions.forms.setup import SessionForm
from rehab.studies.models import Arm, Study
from tests.support.world import NOW, World


class Walked(forms.Form):
    """Numbers as pages ask for them."""

    speed = NumberField(least=0.1, most=2.5, unit="m/s")
    share = WholeNumberField(least=1, most=100, unit="%")
    count = WholeNumberField(least=2)


def errors_of(form: Any) -> dict[str, str]:
    return {name: " ".join(errors) for name, errors in form.errors.items()}


@pytest.mark.parametrize("low", [True, False])
def test_all_of_the_range_is_said_in_the_pages_unit_and_language(low: bool) -> None:
    form = Walked({"speed": "0,05" if low else "3", "share": "0" if low else "101", "count": "1"})
    assert errors_of(form) == {
        "speed": "Give 0.1 to 2.5 m/s.",
        "share": "Give 1 to 100 %.",
        "count": "Give 2 or more.",
    }
    with translation.override("de"):
        assert "0,1" in str(range_message(0.1, 2.5, "m/s"))
    assert Walked({"speed": "1,5", "share": "50", "count": "2"}).is_valid()
    assert "min=" not in form.as_p()  # the browser would say it without a unit


@pytest.mark.parametrize(
    ("least", "most", "unit", "said"),
    [
        (1, None, "", "Give 1 or more."),
        (1, None, "m", "Give 1 m or more."),
        (None, 2, "", "Give up to 2."),
        (None, 2, "m", "Give up to 2 m."),
    ],
)
def test_a_range_may_be_open_at_one_end(least: Any, most: Any, unit: str, said: str) -> None:
    assert str(range_message(least, most, unit)) == said


@pytest.mark.django_db
def test_the_set_up_says_its_ranges(world: World) -> None:
    given = {
        "goal_by": "value",
        "goal_value": "99",
        "goal_percent": "10",
        "wanted_hits": "0",
        "minutes": "500",
        "robot_threshold": "900",
        "robot_window": "0.5",
        "belt_speed": "40",
        "weight_support": "300",
        "schedule_band": "80",
        "measure": str(world.session.measure_id),
    }
    form = SessionForm(given, patient=world.patient, by=world.people[Role.LEAD])
    said = errors_of(form)
    assert said["goal_percent"] == "Give 50 to 200 %."
    assert said["wanted_hits"] == "Give 1 to 100 %."
    assert said["minutes"] == "Give 1 to 240 minutes."
    assert said["robot_threshold"] == "Give 1 to 200 %."
    assert said["robot_window"] == "Give 2 to 60 s."
    assert said["schedule_band"] == "Give 1 to 50 %."
    assert said["belt_speed"].endswith("m/s.")
    assert said["weight_support"].endswith("%.")
    assert said["goal_value"].endswith("up to 2 m.")  # the unit of its measure


@pytest.mark.django_db
@pytest.mark.parametrize("mass", ["-70", "3", "7000"])
def test_a_models_range_is_said_also_below_zero(world: World, mass: str) -> None:
    form = PatientForm(
        {"body_mass_kg": mass, "birth_year": "-3"}, by=world.people[Role.LEAD], now=NOW
    )
    assert errors_of(form)["body_mass_kg"] == "Give 10 to 300 kg."
    assert errors_of(form)["birth_year"] == "Give 1900 to 2100."


@pytest.mark.parametrize(
    ("model", "field", "said"),
    [
        (Arm, "schedule_band", "Give 1 to 50 %."),
        (Study, "goal_percent", "Give 50 to 200 %."),
    ],
)
def test_what_is_stored_is_refused_alike(model: Any, field: str, said: str) -> None:
    with pytest.raises(forms.ValidationError) as refused:
        model._meta.get_field(field).run_validators(10_000)
    assert refused.value.messages == [said]
