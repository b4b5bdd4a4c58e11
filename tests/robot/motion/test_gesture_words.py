"""What the therapist's page says while a gesture plays (static/js/monitor/robot_text.js)."""

from robot.motion.gesture_variants import IDLE, VARIANTS
from robot.motion.gestures import GESTURES
from tests.support.node import run_node


def test_no_variant_is_called_by_its_internal_name():
    names = [*VARIANTS, *GESTURES, *(one.name for one in IDLE)]
    words = dict(zip(names, run_node("describe_gestures.mjs", names), strict=True))
    assert words["joy_12"] == "it celebrates"
    assert words["streak_3_1"] == "it celebrates 3 in a row"
    assert [name for name, said in words.items() if said == name] == []


def test_a_clinics_own_gesture_is_called_by_its_name():
    assert run_node("describe_gestures.mjs", ["Wave 2"]) == ["Wave 2"]
