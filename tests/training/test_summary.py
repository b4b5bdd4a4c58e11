"""A session as plain data for reports."""

from __future__ import annotations

import json

import pytest

from rehab.training.changes import Change, ChangeKind
from rehab.training.fold import SessionFold
from rehab.training.goals import Target
from rehab.training.phases import make_phase
from rehab.training.steps import Side
from rehab.training.summary.summary import summarize_session
from rehab.training.valences import VALENCES
from tests.training.sessions import make_plan, start, walk


def test_a_session_worked_out_by_hand() -> None:
    fold = start(
        make_plan(
            make_phase("baseline", strides=2),
            make_phase("training", strides=3),
            make_phase("catch", strides=1),
            make_phase("training"),
            target=Target(hit_rate=0.6),
        )
    )
    walk(fold, [4.0, None, 5.0, 3.0, 5.0, 5.0, 5.0])
    walk(fold, [5.0], side=Side.RIGHT)
    walk(fold, [3.0], reasons=("flagged",))
    walk(fold, [3.0], reasons=("late", "moment_lost"))
    fold.change(Change(ChangeKind.PAUSE))
    walk(fold, [5.0])
    figures = summarize_session(fold)
    phases = figures.pop("phases")
    metrics = figures.pop("metrics")
    assert figures == {
        "strides": 10,
        "valid": 6,
        "invalid": 2,
        "missing": 1,
        "late": 1,
        "hits": 3,
        "close": 0,
        "hit_rate": 0.75,
        "score": 2,
        "goal": 4.0,
        "active_s": 9.0,
        "target_met": True,
    }
    assert metrics["best_streak"] == 2
    assert [(phase["kind"], phase["strides"], phase["hits"]) for phase in phases] == [
        ("baseline", 2, 1),
        ("training", 6, 3),
        ("catch", 1, 1),
    ]
    training = phases[1]
    assert training["mean"] == 4.5
    assert [(block["phase"], block["strides"]) for block in training["blocks"]] == [(1, 3), (3, 3)]


@pytest.mark.parametrize(
    "other",
    [
        make_phase("training", gain=0.85),
        make_phase("training", "Hard"),
        make_phase("training", feedback=False),
        make_phase("familiarization", "Training"),
    ],
)
def test_only_phases_alike_are_taken_together(other) -> None:
    plan = make_plan(make_phase("training"), other, make_phase("training", strides=9))
    phases = summarize_session(SessionFold(plan))["phases"]
    assert [[block["phase"] for block in phase["blocks"]] for phase in phases] == [[0, 2], [1]]


def test_a_gain_that_was_changed_within_a_phase_has_figures_of_its_own() -> None:
    fold = start(make_plan(make_phase("training")))
    walk(fold, [4.0, 4.0])
    fold.change(Change(ChangeKind.GAIN, 0.9))
    walk(fold, [4.0])
    phases = summarize_session(fold)["phases"]
    assert [(one["gain"], one["strides"], one["hits"]) for one in phases] == [
        (1.0, 2, 2),
        (0.9, 1, 0),
    ]


@pytest.mark.parametrize("valence", VALENCES)
def test_an_empty_session_can_be_told(valence: str) -> None:
    figures = summarize_session(SessionFold(make_plan(valence=valence)))
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures
    assert (figures["strides"], figures["hit_rate"], figures["target_met"]) == (0, None, None)
