"""What is not the protocol is counted, and moves nothing."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rehab.training.steps import InvalidMeasurement, Measurement, Side
from robot.motion.limits import TICK_S
from robot.motion.pose import HOME
from robot.motion.twist import STILL
from robot.wire.limits import TIME_MAX_S
from tests.support.extent import examples
from tests.support.json_values import ANYTHING
from tests.support.robot_stage import CUE, RealBase, Stage

BAD = [
    {"type": "welcome", "session": "7"},
    {"type": "welcome", "session": True, "state": "running", "cue": CUE},
    {"type": "welcome", "session": 9},
    {"type": "welcome", "session": 9, "cue": CUE},
    {"type": "welcome", "session": 9, "cue": CUE | {"window_s": math.nan}, "state": "running"},
    {"type": "welcome", "session": 9, "cue": CUE, "state": "running", "stopped": "no"},
    {"type": "step"},
    {"type": "step", "time_s": "1", "performance": 1},
    {"type": "step", "time_s": math.nan, "performance": 1},
    {"type": "step", "time_s": 1, "performance": math.inf},
    {"type": "step", "time_s": 1e300, "performance": 1},
    {"type": "step", "time_s": 1, "performance": None},
    {"type": "step", "time_s": 1, "performance": 10**400},
    {"type": "welcome", "session": 9, "cue": CUE, "state": "running", "watched": 1},
    {"type": "heartbeat", "watched": "yes"},
    {"type": "state"},
    {"type": "state", "state": {}},
    {"type": "cue"},
    {"type": "cue", "cue": {"above": "celebrate"}},
    {"type": "gesture", "gesture": "celebrate"},
    {"type": "drive", "v_m_s": 1},
    {"type": ["arm"]},
    {"type": None},
    {},
]


@pytest.mark.parametrize("bad", BAD, ids=str)
def test_what_is_not_the_protocol_is_counted_and_moves_nothing(stage, bad):
    stage.walk(0.95, 0.95)
    stage.robot.handle(bad, stage.now_s)
    assert stage.robot.bad_messages == 1
    assert len(stage.robot.last_bad_message) > 15
    stage.wait(2)
    assert stage.base.read().pose == HOME
    assert stage.of("status")[-1]["bad_messages"] == 1


@pytest.mark.parametrize("time_s", [TIME_MAX_S, -TIME_MAX_S, 1.001 * TIME_MAX_S])
def test_a_robot_takes_the_times_of_all_steps_that_are_stored(stage, time_s):
    is_stored = True
    try:
        Measurement(1, time_s, Side.LEFT, 1.0)
    except InvalidMeasurement:
        is_stored = False
    stage.hear(type="step", time_s=time_s, performance=1.0)
    assert (stage.robot.bad_messages == 0) is is_stored


kinds = st.sampled_from(["welcome", "state", "cue", "stop", "arm", "heartbeat", "step", "error"])
frames = st.fixed_dictionaries(
    {"type": kinds | ANYTHING},
    optional={
        "session": st.sampled_from([7, 8, None]) | ANYTHING,
        "state": st.sampled_from(["running", "paused"]) | ANYTHING,
        "cue": st.just(CUE) | ANYTHING,
        "stopped": st.booleans() | ANYTHING,
        "watched": st.booleans() | ANYTHING,
        "time_s": st.floats(0, 60) | ANYTHING,
        "performance": st.floats(0, 2) | ANYTHING,
    },
)


@pytest.mark.wide
@settings(max_examples=examples(80), deadline=None)
@given(st.lists(st.tuples(frames, st.integers(0, 25)), max_size=40))
def test_any_json_moves_a_base_only_by_gestures_that_were_told(told):
    """It never raises; and whatever moves is a gesture that was decided, armed and not stopped."""
    stage = Stage(RealBase)
    armed = False
    for message, ticks in told:
        stage.robot.handle(message, stage.now_s)
        armed = armed or message["type"] == "arm"
        if message["type"] == "stop":
            armed = False
            assert stage.base.read().twist == STILL
        for _ in range(ticks):
            stage.now_s += TICK_S
            stage.robot.tick(stage.now_s)
            moving = not stage.base.read().twist.is_still
            assert not moving or (
                armed and stage.robot.body.player.is_busy and stage.robot.is_linked
            )
        stage.collect()
