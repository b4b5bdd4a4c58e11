"""Other people's walks: which clean strides are valid, their A2, and what the check says."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from statistics import median
from typing import Any

import pytest

from rehab.gait import Flag, check_signals
from tests.gait.corpus import READERS, CorpusWalk, find_clean, open_corpus, vary

pytestmark = pytest.mark.bench

VARIED: dict[str, tuple[str, dict[str, Any]]] = {
    f"{base}, {name}": (base, change)
    for base in ("moore2013", "gaitalytics treadmill")
    for name, change in {
        **(
            {  # gaitalytics brakes the earliest of all
                "brakes 25 ms earlier": {"braking_s": -0.025},
                "brakes 45 ms earlier": {"braking_s": -0.045},
            }
            if base == "moore2013"
            else {}
        ),
        "brakes 25 ms later": {"braking_s": 0.025},
        "brakes 45 ms later": {"braking_s": 0.045},
        "fast": {"tempo": 0.8},
        "slow": {"tempo": 1.5},
        "very slow": {"tempo": 2.6},
        "stiff ankles": {"stiffness": 2.0},
        "orthosis, slow": {"stiffness": 4.0, "tempo": 1.5},
        "a child": {"heavier": 0.4, "tempo": 0.8, "is_mirrored": True},
        "heavy, slow": {"heavier": 1.8, "tempo": 1.5, "braking_s": 0.025},
        "mirrored, stiff": {"stiffness": 2.0, "is_mirrored": True},
    }.items()
}

# The other foot steps on both of its plates, so that its moment scatters from stride to stride.
MISSED = {
    "gaitalytics treadmill, very slow": "2 of 5: the moment scatters by 29 ms",
    "gaitalytics treadmill, fast": "4 of 5: the moment scatters by 29 ms",
    "gaitalytics treadmill, heavy, slow": "4 of 5: the moment scatters by 29 ms",
}


@dataclass(frozen=True)
class Row:
    """What became of a walk: clean strides, those valid, those marked, errors and findings."""

    clean: int
    valid: int
    unusual: int
    error: float
    file_error: float | None
    findings: list[str]
    lost: dict[str, int]


def judge(walk: CorpusWalk) -> Row:
    strides = walk.measure()
    clean = find_clean(walk)
    errors, file_errors, valid, unusual = [], [], 0, 0
    lost: Counter[str] = Counter()
    for one in clean:
        near = [
            s
            for s in strides
            if s.side == one.side and abs(s.terminal_contact_s - one.end_s) < 0.05 and s.valid
        ]
        if not near or near[0].a2_w_kg is None:
            lost.update(
                reason
                for s in strides
                if s.side == one.side and abs(s.terminal_contact_s - one.end_s) < 0.05
                for reason in s.reasons or ["not found"]
            )
            continue
        valid += 1
        unusual += Flag.UNUSUAL_TIMING in near[0].flags
        errors.append(abs(near[0].a2_w_kg / one.a2_w_kg - 1))
        if one.file_a2_w_kg:
            file_errors.append(abs(near[0].a2_w_kg / one.file_a2_w_kg - 1))
    check = check_signals(
        walk.t_s,
        walk.legs.get("left"),
        walk.legs.get("right"),
        rate_hz=walk.rate_hz,
        mass_kg=walk.mass_kg,
    )
    assert not any(finding.doubt for finding in check.findings)
    return Row(
        len(clean),
        valid,
        unusual,
        median(errors) if errors else float("nan"),
        median(file_errors) if file_errors else None,
        [finding.code for finding in check.findings],
        dict(lost),
    )


@pytest.mark.parametrize("name", READERS)
def test_recorded(name):
    row = judge(open_corpus(name))
    show(name, row)
    assert row.valid >= 0.9 * row.clean > 0
    assert row.error <= 0.03


@pytest.mark.parametrize("name", VARIED)
def test_made_up(name, request):
    base, change = VARIED[name]
    if name in MISSED:
        request.applymarker(pytest.mark.xfail(reason=MISSED[name], strict=True))
    row = judge(vary(open_corpus(base), **change))
    show(name, row)
    assert row.valid >= 0.9 * row.clean > 0
    assert row.error <= 0.03


def show(name: str, row: Row) -> None:
    own = "" if row.file_error is None else f", {row.file_error:.1%} from the file's own power"
    print(
        f"\n{name}: {row.valid} of {row.clean} clean strides valid, {row.unusual} marked unusual; "
        f"A2 {row.error:.2%} from the reference{own}; check: {', '.join(row.findings) or 'nothing'}"
        f"{f'; lost by {row.lost}' if row.lost else ''}"
    )
