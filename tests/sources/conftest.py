"""Recordings to read: written by the test, or real ones where they are at hand."""

import os
from pathlib import Path

import numpy as np
import pytest

from rehab.sources.recording import Recording, parse_recording, read_recording
from rehab.sources.synthetic.signals import Sensors
from rehab.sources.synthetic.walker import walk
from tests.sources.intake_harness import MASS
from tests.support.synthetic_recordings import make_signals

REPO = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def real_recording():
    """Read a real recording by its name; skip where there is none (they are never committed)."""
    folder = Path(os.environ.get("GARRY_TEST_DATA", REPO.parent / "shared" / "data")) / "sessions"

    def read(name: str) -> Recording:
        if not (folder / name).exists():
            pytest.skip(f"no {name} in {folder}; set GARRY_TEST_DATA to the folder of recordings")
        return read_recording(folder / name)

    return read


@pytest.fixture
def parse():
    """Parse a recording from its text."""

    def parse(text: str, **settings) -> Recording:
        return parse_recording(text.encode(), "walk.csv", **settings)

    return parse


HEBB03_COLUMNS = (
    *("Task", "ExpTime", "iStrideCt", "iStrideLeg", "iStrideUse"),
    *("iA2_Target", "iA2_Actual", "iA2_Decr", "iA2_Success", "iHS2", "iGRF_AP_propel"),
)


@pytest.fixture
def hebb03():
    """Write a hebb03 recording with one row for every set of changes to a good stride."""

    def write(*changes: dict[str, object]) -> str:
        lines = [",".join(HEBB03_COLUMNS)]
        for number, changed in enumerate(changes, start=1):
            row = {
                "Task": "SSWS",
                "ExpTime": number * 1.08,
                "iStrideCt": number,
                "iStrideLeg": "L",
                "iStrideUse": 1,
                "iA2_Target": 3.9,
                "iA2_Actual": 4.0,
                "iA2_Decr": 4.0,
                "iA2_Success": 1,
                "iHS2": 1.08,
                "iGRF_AP_propel": 1.5,
            } | changed
            lines.append(",".join(str(cell) for cell in row.values()))
        return "\n".join(lines) + "\n"

    return write


@pytest.fixture(scope="module")
def made():
    return make_signals(list(walk(seed=4, strides=30)), MASS, Sensors(rate_hz=200), seed=4)


@pytest.fixture
def table(made):
    legs = (made.left, made.right)
    columns = [c for leg in legs for c in (leg.force_n, leg.moment_nm, leg.angle_rad)]
    return np.column_stack([made.t_s, *columns])
