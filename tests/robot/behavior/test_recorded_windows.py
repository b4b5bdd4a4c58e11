"""Two minutes of a real recording at true speed: windows and decisions equal a recomputation."""

from itertools import pairwise

import numpy as np
import pytest

from rehab.sources.recording import read_recording
from robot.bases import BASES
from robot.behavior.performer import Performer
from robot.motion.limits import TICK_S
from tests.support.data import recording

CUE = {
    "above": "celebrate",
    "below": "droop",
    "threshold": 0.9,
    "window_s": 5,
    "rest_s": 5,
    "intensity": 1,
}


def recompute(times_s, performances):
    """Return the decisions by numpy alone: the whole array at once, gestures in a second pass."""
    number = np.floor((times_s - times_s[0]) / 5).astype(int)
    windows = np.unique(number)
    decisions, last_start_s = [], -np.inf
    for window, following in pairwise(windows):
        inside = performances[number == window]
        if inside.size < 2:
            continue
        ended_s = times_s[number == following][0]
        above = bool(inside.mean() >= 0.9)
        gesture = None
        is_late = ended_s - (times_s[0] + 5 * window + 5) > 5
        if ended_s - last_start_s >= 5 and not is_late:
            gesture, last_start_s = ("celebrate" if above else "droop"), ended_s
        decisions.append((window, inside.size, inside.mean(), above, gesture))
    return decisions


@pytest.mark.parametrize("phase", ["SSWS_85A2", pytest.param("SSWS_90A2", marks=pytest.mark.wide)])
def test_two_minutes_at_true_speed(phase):
    walk = read_recording(recording("HEBB_03_Session_1.csv"))
    index = [one.name for one in walk.phases].index(phase)
    gain = walk.phases[index].gain
    strides = [
        (stride.measurement.time_s, stride.measurement.value * gain / walk.goal)
        for stride in walk.strides
        if stride.phase == index and stride.measurement.value and not stride.measurement.reasons
    ]
    strides = [stride for stride in strides if stride[0] - strides[0][0] < 120]
    times_s, performances = (np.array(column) for column in zip(*strides, strict=True))
    expected = recompute(times_s, performances)

    now_s = start_s = 5000.0  # the robot's clock is not the source's
    base = BASES["kinematic"](lambda: now_s)
    robot = Performer(base)
    welcome = {"type": "welcome", "session": 1, "state": "running", "cue": CUE}
    robot.handle(welcome, now_s)
    decisions, ended = [], []
    for number, (time_s, performance) in enumerate(strides, start=1):
        while now_s - start_s < time_s - times_s[0]:
            now_s += TICK_S
            robot.handle({"type": "heartbeat"}, now_s)
            robot.tick(now_s)
        step = {"type": "step", "number": number, "time_s": time_s, "performance": performance}
        robot.handle(step, now_s)
        while robot.reports:
            report = robot.reports.popleft()
            if report["kind"] == "decision":
                decisions.append(report)
            elif report.get("phase") == "ended":
                ended.append(report["outcome"])
    found = [
        (
            round((decision["from_s"] - times_s[0]) / 5),
            decision["steps"],
            pytest.approx(decision["mean"]),
            decision["above"],
            decision["gesture"],
        )
        for decision in decisions
    ]
    assert found == expected
    assert len(found) > 15
    assert set(ended) == {"done"}
    started = [decision["gesture"] for decision in decisions if decision["gesture"]]
    assert len(ended) in {len(started), len(started) - 1}
