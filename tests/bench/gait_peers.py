"""Times gaitkit and kineticstoolkit on a signal; runs in an environment of their own.

``python gait_peers.py signal.npz`` prints (seconds, events found) by name as JSON. gaitkit knows no
force: it gets the vertical force as the height of ankles, heels and toes, as much work for it.
"""

import json
import sys
import time
import warnings
from functools import partial

import numpy as np

warnings.simplefilter("ignore")


def time_kineticstoolkit(t_s, left_n, right_n):
    import kineticstoolkit as ktk

    series = ktk.TimeSeries(time=t_s, data={"left": left_n, "right": right_n})
    began, events = time.perf_counter(), 0
    for leg in ("left", "right"):
        cycles = ktk.cycles.detect_cycles(
            series,
            leg,
            thresholds=(20, 30),
            min_durations=(0.15, 0.2),
            directions=("falling", "rising"),
        )
        events += len(cycles.events)
    return time.perf_counter() - began, events


def time_gaitkit(t_s, left_n, right_n, method):
    import gaitkit

    rate_hz = (len(t_s) - 1) / (t_s[-1] - t_s[0])
    phase = 2 * np.pi * t_s / 1.1
    frames = []
    for i in range(len(t_s)):
        marks = {}
        for side, force, turn in (("left", left_n, 0), ("right", right_n, np.pi)):
            ahead, up = 300 * np.cos(phase[i] + turn), max(0.0, 100 - 0.5 * force[i])
            for mark, x in (("ankle", ahead), ("heel", ahead - 50), ("toe", ahead + 150)):
                marks[f"{side}_{mark}"] = (x, 0.0, up)
            marks[f"{side}_hip"] = (0.0, 100.0, 900.0)
            marks[f"{side}_knee"] = (ahead / 2, 100.0, 500.0)
        frames.append(
            {
                "frame_index": i,
                "landmark_positions": marks,
                **{
                    f"{s}_{j}_angle": 10 * np.sin(phase[i] + o)
                    for s, o in (("left", 0), ("right", np.pi))
                    for j in ("hip", "knee", "ankle")
                },
            }
        )
    began = time.perf_counter()
    found = gaitkit.detect(frames, method=method, fps=rate_hz, auto_install_deps=False)
    seconds = time.perf_counter() - began
    return seconds, sum(
        len(getattr(found, f"{s}_{e}")) for s in ("left", "right") for e in ("hs", "to")
    )


if __name__ == "__main__":
    signal = np.load(sys.argv[1])
    channels = signal["t_s"], signal["left_n"], signal["right_n"]
    seconds = {}
    for name, run in (
        ("kineticstoolkit detect_cycles", time_kineticstoolkit),
        ("gaitkit zeni", partial(time_gaitkit, method="zeni")),
        ("gaitkit bike", partial(time_gaitkit, method="bike")),
    ):
        try:
            seconds[name] = run(*channels)
        except Exception as error:
            seconds[name] = repr(error)
    print(json.dumps(seconds))
