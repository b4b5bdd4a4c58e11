"""`runsession --base kinematic`: the gestures of a whole recording equal those of an oracle."""

from __future__ import annotations

import json
import math
from io import StringIO
from itertools import pairwise
from typing import Any

import pytest
from django.core.management import call_command

from rehab.sessions.log import Step
from tests.support.data import recording

pytestmark = pytest.mark.django_db(transaction=True)  # the writer has its own connection


def run(valence: str, base: str) -> dict[str, Any]:
    out = StringIO()
    file = recording("HEBB_03_Session_1.csv")
    call_command(
        *("runsession", "--recording", str(file), "--valence", valence, "--gain-from-recording"),
        *("--base", base, "--speed", "max", "--json"),
        stdout=out,
    )
    return dict(json.loads(out.getvalue()))


def kind_of(variant: str) -> str:
    """Return what a variant answers: a strong or a weak window."""
    pool = variant.rpartition("_")[0]
    return "sorry" if pool in ("disappointment", "near_miss", "effort") else "glad"


def expect_gestures(above: str | None, below: str | None) -> list[tuple[str, float]]:
    """Return the kinds of gestures, with the step that starts each, from the stored steps alone."""
    rows = Step.everywhere.filter(valid=True, points__isnull=False).order_by("number")
    steps = [(step.time_s, step.shown / step.goal) for step in rows]
    windows: dict[int, list[tuple[float, float]]] = {}
    for time_s, performance in steps:
        window = math.floor((time_s - steps[0][0]) / 5)
        windows.setdefault(window, []).append((time_s, performance))
    gestures: list[tuple[str, float]] = []
    ordered = sorted(windows)
    for window, following in pairwise(ordered):
        performances = [performance for _, performance in windows[window]]
        if len(performances) < 2:
            continue
        name = above if sum(performances) / len(performances) >= 0.9 else below
        time_s = windows[following][0][0]
        is_fresh = time_s - (steps[0][0] + 5 * window + 5) <= 5
        is_rested = not gestures or time_s - gestures[-1][1] >= 5
        if name and is_fresh and is_rested:
            gestures.append((name, time_s))
    return gestures


@pytest.mark.parametrize(
    ("valence", "above", "below"),
    [
        ("positive", "glad", None),
        ("negative", None, "sorry"),
        ("binary", "glad", "sorry"),
    ],
)
@pytest.mark.long
def test_a_recordings_gestures_are_those_of_the_oracle(valence, above, below):
    result = run(valence, "kinematic")
    expected = expect_gestures(above, below)
    found = [(kind_of(gesture["name"]), gesture["started_s"]) for gesture in result["gestures"]]
    assert [name for name, _ in found] == [name for name, _ in expected]
    assert [s for _, s in found] == pytest.approx([s for _, s in expected], abs=1e-6)
    assert len(found) > 0
    for gesture in result["gestures"]:
        assert gesture["outcome"] == "done"
        assert 1 < gesture["ended_s"] - gesture["started_s"] <= 4
    assert result["robot"]["base"] == "kinematic"
    assert result["robot"]["windows"] > 150
    assert 0.5 < result["robot"]["activated_share"] < 1


@pytest.mark.wide
def test_explicit_feedback_and_a_null_base_have_no_gestures():
    assert run("explicit", "kinematic")["gestures"] == []
    result = run("positive", "null")
    assert result["gestures"] == []
    assert result["robot"]["windows"] > 150
