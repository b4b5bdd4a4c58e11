"""Questionnaires as rules: scales, sums, what is free to ship."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rehab.questionnaires.instrument import Instrument, read_items
from rehab.questionnaires.shipped import SHIPPED, shipped_instrument
from rehab.training.measures import InvalidSetting

LANGUAGES = ("en", "es", "de", "fr")


def test_sus_is_scored_as_it_was_published():
    sus = shipped_instrument("sus", "en")
    assert sus.score([5, 1] * 5) == 100
    assert sus.score([1, 5] * 5) == 0
    assert sus.score([3] * 10) == 50
    assert sus.score([4, 2, 4, 1, 5, 2, 4, 2, 3, 2]) == 77.5  # by hand: 31 × 2.5
    assert sus.score([3] * 9 + [None]) is None


def test_raw_tlx_is_the_mean_of_six_scales_of_21_marks():
    tlx = shipped_instrument("tlx", "en")
    assert [list(item.values) for item in tlx.items] == [list(range(0, 101, 5))] * 6
    assert tlx.score([0, 20, 40, 60, 80, 100]) == 50
    assert tlx.items[3].low == "Perfect"  # this scale alone begins with the good end


@pytest.mark.parametrize("slug", SHIPPED)
def test_every_wording_says_its_source_license_and_whether_it_was_validated(slug):
    english = shipped_instrument(slug, "en")
    for language in LANGUAGES:
        one = shipped_instrument(slug, language)
        assert one.language == language
        assert one.source
        assert one.license
        assert one.validated == (language == "en")
        assert [item.points for item in one.items] == [item.points for item in english.items]
        assert Instrument.from_json(json.loads(json.dumps(one.to_json()))) == one
    assert shipped_instrument(slug, "it") == english
    texts = {item.text for lang in LANGUAGES for item in shipped_instrument(slug, lang).items}
    assert len(texts) == len(LANGUAGES) * len(english.items)


@given(st.integers(-5, 120), st.integers(-2, 8))
def test_an_answer_is_a_point_of_a_scale_of_a_question(value, number):
    tlx = shipped_instrument("tlx", "en")
    if 0 <= number < 6 and value % 5 == 0 and 0 <= value <= 100:
        tlx.check_answer(number, value)
    else:
        with pytest.raises(InvalidSetting, match="Choose one"):
            tlx.check_answer(number, value)


def test_a_clinics_own_questions_are_a_line_each():
    first, second = read_items("Tired? | no | very | 5\n\nFun? | none | much")
    assert (first.text, first.low, first.high, first.points) == ("Tired?", "no", "very", 5)
    assert second.points == 7


@pytest.mark.parametrize(
    ("text", "cure"),
    [
        ("How tired are you?", "Write it as"),
        ("Tired? | no | very | many", "Write it as"),
        ("Tired? | no | very | 1", "2 to 21 points"),
        ("Tired? | no | very | 99", "2 to 21 points"),
        ("| no | very | 5", "1 to 300 letters"),
    ],
)
def test_questions_that_nobody_could_answer_are_refused(text, cure):
    with pytest.raises(InvalidSetting, match=cure):
        read_items(text)


def test_a_questionnaire_has_questions():
    with pytest.raises(InvalidSetting, match="1 to 40 questions"):
        Instrument("x", "x", "", "en", ())
