"""What people of whom nothing was known would see: each constant, chosen again without them."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from rehab.gait import WearableDetector
from rehab.gait.wearables import Place, axis, swings
from rehab.gait.wearables.strides import OFFSETS_S, STRIDE_MIN_S
from tests.support.worn_sensors import (
    STARTS_S,
    Floats,
    Walk,
    count_cycles,
    find_contacts,
    match,
    measure,
    stroke_walks,
    turning_walks,
)

pytestmark = pytest.mark.bench


@pytest.fixture(scope="module")
def walks() -> dict[str, Walk]:
    return {walk.name: walk for walk in stroke_walks()}


def leave_out(costs: dict[str, list[float]]) -> Iterator[tuple[str, int]]:
    """Return for each person the value with the least mean cost for all others.

    Of values whose costs differ by less than 0.001 the middle one.
    """
    for person in sorted({name[:4] for name in costs}):
        others = np.mean([cost for name, cost in costs.items() if name[:4] != person], axis=0)
        best = np.flatnonzero(others < others.min() + 0.001)
        yield person, int(best[len(best) // 2])


def tell(name: str, values: list[float], costs: dict[str, list[float]], say: Callable) -> None:  # type: ignore[type-arg]
    for person, chosen in leave_out(costs):
        own = [cost[chosen] for leg, cost in costs.items() if leg.startswith(person)]
        print(f"\n{name} without {person}: {values[chosen]:g}; {person}: {say(own)}", end="")


def count_share(walk: Walk, cycles: tuple[Floats, Floats]) -> float:
    """Return how many strides there are by swings of the known axis, as a share of all."""
    detector = swings.SwingDetector()
    found = map(detector.add, walk.t_s.tolist(), (-walk.rate[:, 1]).tolist())
    ends = np.array([one.end_s for one in found if one and one.end_s > STARTS_S])
    if len(ends) < 2:
        return 0.0
    begin, end = np.interp(ends[[0, -1]], *cycles)
    return float((np.diff(ends) >= STRIDE_MIN_S).sum() / (end - begin))


@pytest.mark.parametrize(
    ("name", "values", "most"),
    [
        ("SWING_SHARE", [0.2, 0.3, 0.4, 0.5, 0.6], 0.04),
        ("SWING_MIN_S", [0.05, 0.08, 0.11, 0.14, 0.17], 0.04),
        # Who walks with the weakest swings decides it: without pp03 more would do for all others.
        ("SWING_RAD_S", [0.3, 0.5, 0.8, 1.2, 1.75], 0.10),
    ],
)
def test_swings_of_a_left_out_person(name, values, most, walks, monkeypatch):
    costs: dict[str, list[float]] = {leg: [] for leg in walks}
    cycles = {
        leg: count_cycles(walks[leg.replace("right", "left")], walks[leg.replace("left", "right")])
        for leg in walks
    }
    for value in values:
        monkeypatch.setattr(swings, name, value)
        for leg, walk in walks.items():
            costs[leg].append(abs(count_share(walk, cycles[leg]) - 1))
    tell(name, values, costs, lambda own: f"off by {max(own):.1%} or less")
    for person, chosen in leave_out(costs):
        own = [cost[chosen] for leg, cost in costs.items() if leg.startswith(person)]
        assert max(own) <= most


def find_wait(walk: Walk, begin_s: int) -> float:
    """Return after what time the sign is known [s]; 60 where it is not soon, or wrong."""
    detector = WearableDetector(walk.place)
    for first in range(100 * begin_s, 100 * begin_s + 3000, 50):
        cut = slice(first, first + 50)
        detector.feed(walk.t_s[cut], walk.rate[cut], walk.acceleration[cut])
        if detector.left is not None:
            return first / 100 + 0.5 - begin_s if detector.left[1] < -0.5 else 60.0
    return 60.0


def test_sign_of_a_left_out_person(walks, monkeypatch):
    values = [1.0, 2.0, 3.0, 5.0, 10.0]
    costs: dict[str, list[float]] = {f"{leg} {at}": [] for leg in walks for at in (25, 55)}
    for value in values:
        monkeypatch.setattr(axis, "DRIFT_S", value)
        for name, cost in costs.items():
            leg, at = name.split()
            cost.append(find_wait(walks[leg], int(at)))
    tell(
        "DRIFT_S", values, costs, lambda own: f"known after {np.median(own):.1f}, {max(own):.1f} s"
    )
    for person, chosen in leave_out(costs):
        assert max(cost[chosen] for leg, cost in costs.items() if leg.startswith(person)) < 60


def test_offsets_of_a_left_out_person(walks):
    """Of a shank against the foot of the same leg; of a foot against the reference of others."""
    late_ms: dict[str, list[float]] = {}
    contacts = {leg: find_contacts(measure(walk)[0]) for leg, walk in walks.items()}
    for leg in walks:
        if leg.endswith("foot"):
            pair = zip(contacts[leg.replace("foot", "shank")], contacts[leg], strict=True)
            late_ms[leg] = [1000 * float(np.nanmedian(match(shank, foot))) for shank, foot in pair]
    for walk in turning_walks():
        initial, terminal = find_contacts(measure(walk)[0])
        late_ms[f"healthy {walk.name}"] = [
            1000 * float(np.nanmedian(match(found, true)))
            for found, true in ((initial, walk.initial_s), (terminal, walk.terminal_s))
        ]
    for place, kind in ((Place.SHANK, "pp"), (Place.FOOT, "healthy")):
        legs = {name: late for name, late in late_ms.items() if name.startswith(kind)}
        cut = slice(0, 4) if kind == "pp" else slice(8, 9)
        beside = []
        for person in sorted({name[cut] for name in legs}):
            others = np.median([late for name, late in legs.items() if name[cut] != person], axis=0)
            own = np.median([late for name, late in legs.items() if name[cut] == person], axis=0)
            beside.append(own - others)
            offsets = (1000 * np.array(OFFSETS_S[place]) - others).round()
            print(f"\n{place} without {person}: {offsets}, off by {beside[-1].round()} ms", end="")
        assert (np.median(np.abs(beside), axis=0) <= 15).all()
