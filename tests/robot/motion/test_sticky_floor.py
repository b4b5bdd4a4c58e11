"""Sticky floors: wheels that follow no slow order, on bases that nobody has measured."""

import pytest

from robot.bases.kinematic import Imperfections
from robot.motion.base_response import AT_ONCE
from robot.motion.gesture_variants import VARIANTS
from robot.motion.gestures import BUILT_IN
from tests.support.gesture_runs import OrdinaryBase, play_in_a_row, play_seen
from tests.support.robot_stage import CUE, WELCOME, Stage
from tests.support.variants import GENTLE, at_level, cases

pytestmark = pytest.mark.matrix
LATE = 0.2


@pytest.mark.parametrize("name", cases(BUILT_IN))
@pytest.mark.parametrize("stiction_m_s", [0.0, 0.02, 0.03, 0.038, 0.05])
def test_every_gesture_comes_home(name, stiction_m_s):
    faults = Imperfections(LATE, 0.04, stiction_m_s, left_scale=0.98, drift_deg_min=3.0)
    for played in play_in_a_row(BUILT_IN[name], faults, times=2):
        assert played.outcome == "done"
        assert played.away_m < 0.02
        assert played.turned_deg < 2


@pytest.mark.parametrize("name", ["droop", "sway", "joy_3", "disappointment_1", "near_miss_3"])
@pytest.mark.parametrize("stiction_m_s", [0.03, 0.05])
def test_gentle_answers_are_no_smaller_for_it(name, stiction_m_s):
    """Droop ended out of time there at all sizes, and latched (issue 36)."""
    stage = Stage(lambda clock: OrdinaryBase(clock, Imperfections(LATE, 0.04, stiction_m_s)))
    stage.hear(**WELCOME | {"cue": CUE | {"below": name, "intensity": 0.5}})
    headings_rad, ways_m = [], []
    stage.hear(type="arm")
    for second in range(21):
        stage.hear(type="step", time_s=float(second), performance=0.4)
        for _ in range(50):
            stage.wait(0.02)
            pose = stage.base.ground_truth().pose
            headings_rad.append(pose.heading_rad)
            ways_m.append(pose.x_m)
    assert set(stage.ended) == {"done"}
    swept_rad = max(headings_rad) - min(headings_rad)
    assert max(swept_rad, 8 * max(ways_m)) >= (0.75 if "_" in name else 0.15)
    assert stage.robot.body.safety.latch == ""


@pytest.mark.parametrize("name", cases(name for name in VARIANTS if name in GENTLE))
@pytest.mark.parametrize("stiction_m_s", [0.008, 0.0495])
def test_gentle_variants_are_seen_in_time(name, stiction_m_s):
    faults = Imperfections(0.25, 0.06, stiction_m_s, left_scale=0.98, drift_deg_min=3.0)
    gesture, pace = at_level(VARIANTS[name], "gentle")
    seen = play_seen(gesture, faults, pace)
    assert seen.outcome == "done"
    assert seen.took_s <= 4.4
    assert seen.away_m >= 0.10 or seen.swept_deg >= 45


def test_without_a_least_speed_they_would_not(monkeypatch):
    faults = Imperfections(LATE, 0.04, 0.05)
    played = play_in_a_row(BUILT_IN["droop"], faults, times=2, response=AT_ONCE)
    assert played[-1].outcome != "done"
