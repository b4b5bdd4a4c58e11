"""The states of a session: every change in every state."""

from __future__ import annotations

import copy
import math
from typing import Any

import pytest

from rehab.training.changes import (
    STATE_LABELS,
    Change,
    ChangeKind,
    ChangeValue,
    NotAllowed,
    PauseReason,
    State,
)
from rehab.training.controls import CONTROLS
from rehab.training.feedback_bands import bands_to_json
from rehab.training.fold import SessionFold
from rehab.training.measures import InvalidSetting
from rehab.training.phases import make_phase
from rehab.training.valences import BINARY, NEGATIVE
from tests.support.folds import fold_log
from tests.training.sessions import make_plan, step_at, walk

K, S = ChangeKind, State

WAY_TO = {
    S.READY: (),
    S.RUNNING: (K.START,),
    S.PAUSED: (K.START, K.PAUSE),
    S.FINISHED: (K.START, K.FINISH),
    S.ABORTED: (K.ABORT,),
}
LEADS_TO: dict[tuple[ChangeKind, State], State] = {
    (K.START, S.READY): S.RUNNING,
    (K.PAUSE, S.RUNNING): S.PAUSED,
    (K.RESUME, S.PAUSED): S.RUNNING,
    (K.FINISH, S.RUNNING): S.FINISHED,
    (K.FINISH, S.PAUSED): S.FINISHED,
    **{(K.ABORT, state): S.ABORTED for state in (S.READY, S.RUNNING, S.PAUSED)},
    **{
        (kind, state): state
        for kind in K
        if kind not in (K.START, K.PAUSE, K.RESUME, K.FINISH, K.ABORT)
        for state in (S.READY, S.RUNNING, S.PAUSED)
    },
}
NUMBERS = {
    K.GOAL: 3.0,
    K.GAIN: 0.9,
    K.PHASE: 1.0,
    K.ACTIVATION_THRESHOLD: 1.2,
    K.ROBOT_INTENSITY: 0.0,
    K.WORDS_SHOWN: 0.0,
}
VALUES: dict[ChangeKind, ChangeValue] = {
    **NUMBERS,
    K.VALENCE: "negative",
    K.VALENCE_NOW: "negative",
    K.CHART_STYLE: "line",
    K.GOAL_ADAPTATION: "automatic",
    K.FEEDBACK_TEXT: {"valence": "binary", "bands": bands_to_json(BINARY.bands)},
}


def session_in(state: State) -> SessionFold:
    plan = make_plan(make_phase("baseline"), make_phase("training"), alternatives=(NEGATIVE,))
    return fold_log(plan, [Change(kind) for kind in WAY_TO[state]])


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("kind", ChangeKind)
def test_a_change_leads_on_or_is_refused_in_words(kind: ChangeKind, state: State) -> None:
    fold = session_in(state)
    before = copy.deepcopy(vars(fold))
    change = Change(kind, VALUES.get(kind))
    if (kind, state) in LEADS_TO:
        fold.change(change)
        assert fold.state is LEADS_TO[kind, state] is CONTROLS[kind].next_state(state)
    else:
        label = STATE_LABELS[state]
        with pytest.raises(NotAllowed, match=f"that is {label} cannot .* '{kind}'; it must be "):
            fold.change(change)
        assert vars(fold) == before


@pytest.mark.parametrize("state", State)
def test_steps_come_only_while_running_or_paused(state: State) -> None:
    fold = session_in(state)
    if state in (S.RUNNING, S.PAUSED):
        assert step_at(fold, 1.0).valid == (state is S.RUNNING)
    else:
        before, label = copy.deepcopy(vars(fold)), STATE_LABELS[state]
        with pytest.raises(NotAllowed, match=f"is {label} takes no steps; it must be running"):
            step_at(fold, 1.0)
        assert vars(fold) == before


@pytest.mark.parametrize("kind", VALUES)
@pytest.mark.parametrize("value", [None, True, [], {}, {"valence": []}, "", math.nan])
def test_a_change_without_its_value_is_refused(kind: ChangeKind, value: Any) -> None:
    fold = session_in(S.RUNNING)
    before = copy.deepcopy(vars(fold))
    wanted = f"'{kind}' needs a value" if kind in NUMBERS and value is None else None
    with pytest.raises(InvalidSetting, match=wanted):
        fold.change(Change(kind, value))
    assert vars(fold) == before


@pytest.mark.parametrize("kind", VALUES)
def test_the_same_change_again_alters_nothing(kind: ChangeKind) -> None:
    fold = session_in(S.RUNNING)
    fold.change(Change(kind, VALUES[kind]))
    before = copy.deepcopy(vars(fold))
    fold.change(Change(kind, VALUES[kind]))
    assert vars(fold) == before


def test_a_pause_has_a_reason_until_the_session_goes_on() -> None:
    fold = session_in(S.RUNNING)
    fold.change(Change(K.PAUSE, "restart"))
    assert fold.pause_reason is PauseReason.RESTART
    fold.change(Change(K.RESUME))
    assert fold.pause_reason is None
    fold.change(Change(K.PAUSE))  # as logs have it that are older than reasons
    assert fold.pause_reason is None


@pytest.mark.parametrize(
    ("kind", "value", "cure"),
    [
        (K.GOAL, 0.0, "above 0 and up to 15 W/kg"),
        (K.GOAL, math.nan, "above 0 and up to 15 W/kg"),
        (K.GAIN, 2.0, "0.5 to 1.5"),
        (K.ACTIVATION_THRESHOLD, 90.0, "0.9 for 90 %"),
        *((K.ROBOT_INTENSITY, value, r"gentle \(0.5\)") for value in (-1, 0.3, 2, math.nan)),
        (K.WORDS_SHOWN, 0.5, "shown"),
        (K.CHART_STYLE, "bars", "points, line"),
        (K.VALENCE, "happy", "binary, negative"),
        (K.VALENCE_NOW, "happy", "binary, negative"),
        (K.FEEDBACK_TEXT, {"valence": "positive", "bands": []}, "one of the session's"),
        (K.FEEDBACK_TEXT, {"valence": "binary", "bands": []}, "begins at 0"),
        (K.FEEDBACK_TEXT, {"valence": "binary", "bands": [{"words": "Go"}]}, "from_performance"),
        *((K.PHASE, value, "0 to 1") for value in (-1, 0.5, 2, 1e308, math.nan, math.inf)),
    ],
)
def test_a_value_out_of_bounds_is_refused_with_the_cure(
    kind: ChangeKind, value: Any, cure: str
) -> None:
    fold = session_in(S.RUNNING)
    before = copy.deepcopy(vars(fold))
    with pytest.raises(InvalidSetting, match=cure):
        fold.change(Change(kind, value))
    assert vars(fold) == before


def test_a_change_holds_from_the_next_step_on() -> None:
    fold = session_in(S.RUNNING)
    fold.change(Change(K.PHASE, 1.0))
    (before,) = walk(fold, [4.0])
    fold.change(Change(K.GOAL, 5.0))
    fold.change(Change(K.GAIN, 1.5))
    fold.change(Change(K.ACTIVATION_THRESHOLD, 1.1))
    fold.change(Change(K.ROBOT_INTENSITY, 0.5))
    (after,) = walk(fold, [4.0])
    assert (before.goal, before.gain, before.hit) == (4.0, 1.0, True)
    assert (after.goal, after.gain, after.shown, after.performance) == (5.0, 1.5, 6.0, 1.2)
    assert fold.score == 2
    assert fold.activation_threshold == 1.1
    assert fold.robot_intensity == 0.5
