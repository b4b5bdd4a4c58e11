"""Gestures on bases that are late, slip and drift: home each time, twenty times in a row.

A table of dead time and lag for each gesture, on the kinematic simulation: it needs no real time.
Nobody tells the player how late the base is.
"""

import pytest

from robot.bases.kinematic import Imperfections
from robot.motion.gesture_variants import VARIANTS
from robot.motion.gestures import BUILT_IN, ORIGINALS
from tests.support.gesture_runs import play_in_a_row

TIMES = 20
DEAD_TIMES_S = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25)
LAGS_S = (0.02, 0.04, 0.06)
SLIP, DRIFT_DEG_MIN = 0.02, 3.0
AWAY_M, TURNED_DEG = 0.02, 2.0
DEFAULT_S = 4.5  # all but the paper's at 0.2 s


@pytest.mark.parametrize("name", BUILT_IN)
def test_they_end_at_home(name):
    times = 2 if name in VARIANTS else TIMES  # there are some 80
    print(f"\n{name}, {times} in a row each: longest, farthest from home after it")
    bad = []
    for dead_time_s in DEAD_TIMES_S:
        line = f"  {1000 * dead_time_s:3.0f} ms"
        for lag_s in LAGS_S:
            faults = Imperfections(
                dead_time_s, lag_s, left_scale=1 - SLIP, drift_deg_min=DRIFT_DEG_MIN
            )
            played = play_in_a_row(BUILT_IN[name], faults, times)
            outcomes = {one.outcome for one in played}
            took_s = max(one.took_s for one in played)
            away_m = max(one.away_m for one in played)
            turned_deg = max(one.turned_deg for one in played)
            line += f"   {1000 * lag_s:.0f} ms: {took_s:5.2f} s {1000 * away_m:4.1f} mm "
            line += f"{turned_deg:4.2f}°{'' if outcomes == {'done'} else f' {outcomes}'}"
            is_late = name not in ORIGINALS and dead_time_s <= 0.2 and took_s > DEFAULT_S
            if outcomes != {"done"} or away_m > AWAY_M or turned_deg > TURNED_DEG or is_late:
                bad.append((dead_time_s, lag_s))
        print(line)
    assert not bad
