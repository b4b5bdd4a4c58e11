"""Checks of JSON frames: what is taken, and what is refused with the cure."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.wire.frames import (
    MAX_NESTING,
    BadFrame,
    check_values,
    read_name,
    read_number,
    read_object,
    read_whole,
)
from robot.wire.limits import MAX_FRAME_BYTES, MAX_NAME_CHARS
from tests.support.json_values import ANYTHING


@pytest.mark.parametrize(
    ("text", "cure"),
    [
        (None, "Send text frames"),
        ("x" * (MAX_FRAME_BYTES + 1), "send smaller ones"),
        ("[" * 10_000, "one JSON object"),
        ('{"type": NaN}', "Send null"),
        ('{"type": 1}', 'JSON object with a "type"'),
        ("[1]", 'JSON object with a "type"'),
    ],
    ids=["binary", "long", "nested", "NaN", "type", "list"],
)
def test_what_is_no_frame_is_refused_with_the_cure(text, cure):
    with pytest.raises(BadFrame, match=cure) as refused:
        read_object(text)
    assert refused.value.code == "bad_frame"


def test_a_frame_is_its_object():
    assert read_object('{"type": "step", "value": null}') == {"type": "step", "value": None}


@pytest.mark.parametrize("value", [None, "1", True, math.nan, math.inf, 10**400, 1.1, -0.1])
def test_a_number_is_finite_and_within_its_bounds(value):
    with pytest.raises(BadFrame, match="from 0 to 1"):
        read_number({"share": value}, "share", 0.0, 1.0)


@given(st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(2**53), 2**53))
def test_every_finite_number_is_one(value):
    assert read_number({"x": value}, "x") == value


@pytest.mark.parametrize("value", [None, 1.0, True, 0, 2**31, "1"])
def test_a_whole_number_is_within_its_bounds(value):
    with pytest.raises(BadFrame, match="whole number of 1 or more"):
        read_whole({"n": value}, "n", low=1)


@pytest.mark.parametrize("name", ["", "a b", "ä", "x" * (MAX_NAME_CHARS + 1), 3, None])
def test_a_name_is_short_and_plain(name):
    with pytest.raises(BadFrame, match=f"1 to {MAX_NAME_CHARS} letters"):
        read_name({"run": name}, "run")
    assert read_name({"run": "x" * MAX_NAME_CHARS}, "run") == "x" * MAX_NAME_CHARS


def test_values_nest_so_deep_and_no_deeper():
    value: object = 1.0
    for _ in range(MAX_NESTING):
        value = [value]
    check_values(value)
    with pytest.raises(BadFrame, match="nest at most"):
        check_values([value])


@pytest.mark.parametrize("half", ["\0", chr(0xD83D), chr(0xDE00)], ids=ascii)
def test_texts_and_names_hold_only_what_a_database_stores(half):
    check_values({"smile": ["\N{SMILING FACE WITH OPEN MOUTH}", "é\n", ""]})
    for value in (f"a{half}", [half], {"a": {"b": half}}, {f"{half}b": 1}):
        with pytest.raises(BadFrame, match="Leave it out"):
            check_values(value)


@given(ANYTHING)
def test_only_bad_frames_are_raised_for_any_value(value):
    try:
        check_values(value)
    except BadFrame as refused:
        assert "." in str(refused)
