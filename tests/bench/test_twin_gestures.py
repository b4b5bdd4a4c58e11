"""Every gesture on the twin, with wheels that are not what they should be: home in truth."""

import math
import random
import time

import pytest

from robot.bases.twinned import TwinBase
from robot.behavior.safety import AWAY
from robot.motion.gestures import GESTURES, ORIGINALS
from robot.motion.limits import TETHER_M
from robot.play_gesture import play_gesture

TIMES = 20


def run(name, seed, times):
    chance = random.Random(seed)
    wheels = [f"--{side}-scale={chance.uniform(1.0, 1.02):.4f}" for side in ("left", "right")]
    with TwinBase(time.monotonic, *wheels) as twin:
        for number in range(times):
            played = play_gesture(
                ({**GESTURES} | ORIGINALS)[name], twin, time.monotonic, time.sleep
            )
            pose = played["true_pose"]
            away_m = math.hypot(pose["x_m"], pose["y_m"])
            turned_deg = math.degrees(abs(math.remainder(pose["heading_rad"], math.tau)))
            yield number, played, away_m, turned_deg
            if played["outcome"] == AWAY:  # refused, and the tether not left
                return


@pytest.mark.parametrize(
    ("name", "times"), [("celebrate", TIMES), *((name, 2) for name in {**GESTURES} | ORIGINALS)]
)
def test_it_comes_home(name, times):
    worst_m, worst_deg, farthest_m, outcomes = 0.0, 0.0, 0.0, []
    for _, played, away_m, turned_deg in run(name, seed=5, times=times):
        outcomes.append(played["outcome"])
        farthest_m = max(farthest_m, played["true_farthest_m"])
        if played["outcome"] == "done":
            worst_m, worst_deg = max(worst_m, away_m), max(worst_deg, turned_deg)
    print(
        f"{name:18} n {len(outcomes):2}   furthest from home after it {1000 * worst_m:4.1f} mm "
        f"{worst_deg:4.2f}°   tether {1000 * farthest_m:4.0f} of {1000 * TETHER_M:.0f} mm   "
        f"{set(outcomes)}"
    )
    assert worst_m <= 0.02
    assert worst_deg <= 2
    assert farthest_m <= TETHER_M
    assert set(outcomes) <= {"done", AWAY}
