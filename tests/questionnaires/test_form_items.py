"""A clinic's own form: how its lines are read, what is asked back, and its sum."""

from __future__ import annotations

import json

import pytest

from rehab.questionnaires.form_items import FormItem, read_form_items, total
from rehab.questionnaires.standard_tests import ClinicalTest, Way
from rehab.training.measures import InvalidSetting

FORM = """
Knee bends | 0 | 2
Knee angle | 0.0 | 150.0 | 20 | 120
Tone | none, some, much
Shoes | text
"""


def test_each_line_is_an_item():
    assert read_form_items(FORM) == (
        FormItem(text="Knee bends", most=2),
        FormItem(text="Knee angle", most=150, places=1, usual=(20, 120)),
        FormItem(text="Tone", most=2, words=("none", "some", "much")),
        FormItem(text="Shoes", is_text=True),
    )


@pytest.mark.parametrize(
    "line",
    [
        *("Knee", "Knee | 2 | 0", "Knee | 0 | x", "Knee | 0 | 2 | 1", "Knee | 0 | 2 | -1 | 1"),
        *("Knee | 0 | 2 | 1 | 3", " | 0 | 2", "Knee | 0 | 1e9", "Knee | nan | 2", "Tone | some"),
        *("Knee | 0 | ²", "Knee | 0 | 1234567", f"{'K' * 200} | 0 | 2"),
    ],
)
def test_a_line_that_is_none_is_named_with_its_cure(line):
    with pytest.raises(InvalidSetting, match="Knee bends") as refused:
        read_form_items(f"Tone | none, some\n{line}")
    assert line.strip()[:40] in str(refused.value)


@pytest.mark.parametrize("text", ["", "Shoes | text", "Knee | 0 | 2\n" * 61])
def test_a_form_counts_something_and_is_not_endless(text):
    with pytest.raises(InvalidSetting, match="1 to 60 items"):
        read_form_items(text)


def test_the_result_is_the_sum_of_numbers_and_choices():
    items = read_form_items(FORM)
    assert total(items, [2.0, 0.1 + 0.2, 1.0, "trainers"]) == 3.3


@pytest.mark.parametrize(("angle", "asked"), [(19.9, True), (20, False), (120, False), (121, True)])
def test_a_number_outside_of_what_is_usual_is_asked_back(angle, asked):
    (_bends, knee, *_others) = read_form_items(FORM)
    assert knee.is_unusual(angle) == asked


def test_a_test_is_registered_as_plain_data_and_read_again():
    test = ClinicalTest(
        slug="own-knee",
        label="Knee",
        unit="",
        places=1,
        least=0,
        most=154,
        higher_is_better=False,
        way=Way.FORM,
        steps=("Sit.",),
        items=read_form_items(FORM),
    )
    stored = json.dumps(test.to_json())
    again = ClinicalTest.from_json(json.loads(stored))
    assert json.dumps(again.to_json()) == stored
    assert again.way is Way.FORM
    assert [item.is_unusual(10) for item in again.items] == [False, True, False, False]
