"""All faults by their names, and the walks that they are put into."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np

from tests.gait.faults.spoil import (
    drag,
    drift,
    even_out,
    fill,
    lag,
    land_on_toes,
    lean_on_cane,
    lose,
    scale,
    scuff,
    shake,
    shift,
    stall,
    straddle,
    swap,
    take_knee,
    weigh,
)
from tests.gait.faults.tally import Tally, count
from tests.gait.walks import ANGLE, FORCE, MOMENT, Walk, make_walk, read_moore

KINDS: dict[str, dict[str, float]] = {
    "100 Hz": {},
    "1 kHz": {"rate_hz": 1000},
    "slow 200 Hz": {"rate_hz": 200, "a2_w_kg": 0.8, "stride_s": 1.8, "mass_kg": 60.0},
    "fast 100 Hz": {"a2_w_kg": 5.0, "stride_s": 0.95, "mass_kg": 90.0},
}
RECORDINGS = ("moore", *KINDS)

FAULTS: dict[str, Callable[..., Walk]] = {
    "none": lambda walk, _clean: walk,
    **{f"stall {ms} ms": partial(stall, width_s=ms / 1000) for ms in (15, 30, 50, 82, 150)},
    **{
        f"stall {ms} ms, HBM": partial(stall, width_s=ms / 1000, by_stamp=True)
        for ms in (15, 30, 50, 82, 150)
    },
    **{f"loss {ms} ms": partial(lose, width_s=ms / 1000) for ms in (10, 30, 60, 120, 240)},
    **{
        f"drift of {name} to {ms:+d} ms": partial(drift, rows=[row], last_s=ms / 1000)
        for name, row in (("angle", ANGLE), ("moment", MOMENT))
        for ms in (-100, 100)
    },
    **{
        f"{name} {ms:+d} ms": partial(lag, rows=[row], lag_s=ms / 1000)
        for name, row in (("angle", ANGLE), ("moment", MOMENT))
        for ms in (-100, -50, -20, -10, 10, 20, 50, 100)
    },
    **{
        f"{name} × {factor:g}": partial(scale, rows=[row], factor=factor)
        for name, row, factors in (
            ("force", FORCE, (-1, 0.1020, 0.2248, 0.0127, 0.8, 1.25)),
            ("moment", MOMENT, (-1, 0.001, 1000, 0.7376, 0.8, 1.2, 0.0133)),
            ("angle", ANGLE, (-1, 57.2958, 0.8, 1.2, 1.56)),
        )
        for factor in factors
    },
    **{f"mass × {factor:g}": partial(weigh, factor=factor) for factor in (0.7, 0.9, 1.1, 1.2, 1.3)},
    **{f"moment {nm:+d} Nm": partial(shift, rows=[MOMENT], by=nm) for nm in (-5, 5)},
    "the knee's angle": take_knee,
    **{f"cane {share:.0%}": partial(lean_on_cane, share=share) for share in (0.1, 0.15)},
    "toes first": land_on_toes,
    **{f"even grid, {ms} ms": partial(even_out, width_s=ms / 1000) for ms in (30, 82)},
    **{
        f"gaps of {ms} ms filled {name}": partial(fill, width_s=ms / 1000, order=order)
        for name, order in (("straight", 1), ("by a curve", 3))
        for ms in (100, 200)
    },
    "swap force": partial(swap, rows=[FORCE]),
    "swap moment": partial(swap, rows=[MOMENT]),
    "swap angle": partial(swap, rows=[ANGLE]),
    "swap moment and angle": partial(swap, rows=[MOMENT, ANGLE]),
    **{f"drag {force} N": partial(drag, force_n=force) for force in (25, 40, 50, 60)},
    "drag 90 N, first third": partial(drag, force_n=90, low=0.0, high=0.3),
    **{
        f"drag {force} N, {name}": partial(drag, force_n=force, low=low, high=high)
        for name, low, high in (
            ("first third", 0.0, 0.3),
            ("first half", 0.0, 0.5),
            ("second half", 0.5, 1.0),
            ("last third", 0.7, 1.0),
            ("whole swing", 0.0, 1.0),
        )
        for force in (25, 40, 50, 60)
    },
    **{f"scuff {force} N": partial(scuff, force_n=force) for force in (60, 150)},
    "straddle": straddle,
    **{f"clonus {share:g}": partial(shake, share=share) for share in (0.5, 1.0)},
}
CERTAIN_DRAGS = [name for name in FAULTS if name.startswith(("drag 40", "drag 50", "drag 60"))]
SLOW_STRIDES_S = (2.2, 2.8, 3.4, 4.0)


@cache
def open_walk(name):
    """Return a recording and its strides without a fault."""
    walk = read_moore()[0] if name == "moore" else make_walk(strides=30, seed=1, **KINDS[name])[0]
    return walk, walk.both_legs()


def try_fault(name: str, fault: str, side: str = "left") -> Tally:
    """Return what a fault does to a leg's strides of a recording.

    Where the check of the first half minute doubts them, none is shown until a person has looked.
    """
    walk, clean = open_walk(name)
    spoiled = FAULTS[fault](walk, clean)
    with np.errstate(all="ignore"):
        found = spoiled.both_legs()
        tally = count(found, clean, side)
        if not tally.wrong:
            return tally
        doubts = {finding.doubt for finding in spoiled.check(found).findings} - {""}
        return replace(count([], clean, side), doubts=tuple(doubts)) if doubts else tally
