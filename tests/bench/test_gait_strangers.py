"""Walks of other people in files of other labs: one command each, to A2."""

from typing import Any

import pytest

from tests.gait.corpus import open_corpus, vary
from tests.gait.strangers import FILES, from_zero, judge

pytestmark = pytest.mark.bench

PEOPLE: dict[str, tuple[str, dict[str, Any], float | None]] = {
    "moore2013": ("moore2013", {}, 100),
    "gaitalytics": ("gaitalytics treadmill", {}, None),
    "BTK motion3, overground": ("BTK motion3", {}, None),
    "OpenSim subject01, overground": ("OpenSim subject01", {}, 200),
    "brakes early": ("moore2013", {"braking_s": -0.045}, 100),
    "brakes late": ("moore2013", {"braking_s": 0.025}, 100),
    "slow, stiff": ("moore2013", {"tempo": 2.2, "stiffness": 3.0}, 100),
    "a child, mirrored": ("moore2013", {"heavier": 0.4, "tempo": 0.8, "is_mirrored": True}, 250),
    "heavy, slow": ("moore2013", {"heavier": 1.8, "tempo": 1.5}, 60),
}


@pytest.mark.parametrize("who", PEOPLE)
def test_people_in_strangers_files(who, tmp_path):
    name, change, rate_hz = PEOPLE[who]
    walk = open_corpus(name)
    walk = from_zero(vary(walk, **change) if change else walk, rate_hz)
    missed = []
    for file, write in FILES.items():
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        found = judge(write(folder, walk), walk, walk.mass_kg)
        if found.valid < 0.9 * found.clean or not abs(found.error) <= 0.03:
            missed.append(f"{file}: {found.valid} of {found.clean}, {found.error:+.1%}")
    print(f"\n{who}: {len(FILES) - len(missed)} of {len(FILES)} files", *missed, sep="\n  ")
    assert not missed
