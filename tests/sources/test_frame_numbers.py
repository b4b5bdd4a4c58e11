"""Frame numbers of a device tell what is late and what is lost."""

import numpy as np
import pytest

from rehab.gait import measure_strides
from rehab.gait.recordings.column_mapping import read_column_map
from rehab.gait.recordings.readers import read_signals
from tests.sources.intake_harness import MASS, NAMES, IntakeHarness, measure, rows_of


def spoil_stamps(table):
    """Return rows of which 20 ms are lost in a stall of 80 ms each second, with their numbers."""
    stamps, kept = table[:, 0].copy(), np.ones(len(table), dtype=bool)
    for at in range(300, len(table) - 20, 210):
        stamps[at : at + 16] = table[at + 16, 0] + 0.0005 * np.arange(-16, 0)
        kept[at + 4 : at + 8] = False
    rows = rows_of(np.column_stack((stamps, table[:, 1:])))
    numbered = [row | {"frame": 7000.0 + n} for n, row in enumerate(rows)]
    return [row for row, one in zip(numbered, kept, strict=True) if one]


def test_frame_numbers_tell_what_is_late_and_what_is_lost(made, table):
    expected = [s.a2_w_kg for s in measure(made) if s.valid]
    rows = spoil_stamps(table)
    numbered, stamped = IntakeHarness(), IntakeHarness()
    numbered.send(rows)
    stamped.send([{name: cell for name, cell in row.items() if name != "frame"} for row in rows])
    for harness in (numbered, stamped):
        harness.intake.finish()
    line = numbered.intake.describe()
    shown = [m.value for m in numbered.strides() if not m.reasons]

    assert len(shown) >= 0.95 * len(expected)
    assert len([m for m in stamped.strides() if not m.reasons]) < 0.9 * len(expected)
    assert not any("frame" in text for text in numbered.said)
    assert "late by up to 7" in line
    assert "times lost for up to 25 ms" in line


@pytest.mark.wide
def test_frame_numbers_of_channels_in_rows_of_their_own(made, table):
    """Those of the forces count; the cameras' are another count."""
    harness = IntakeHarness()
    rows = []
    for n, row in enumerate(rows_of(table)):
        forces = {name: row[name] for name in row if name == "time_s" or "force" in name}
        rows.append(forces | {"frame": 100.0 + n})
        if n % 2 == 0:
            others = {name: row[name] for name in row if "force" not in name}
            rows.append(others | {"frame": float(n // 2)})
    harness.send(rows)
    harness.intake.finish()
    shown = [m.value for m in harness.strides() if not m.reasons]
    expected = [s.a2_w_kg for s in measure(made) if s.valid]

    assert len(shown) >= len(expected) - 2
    assert not any("frame" in text for text in harness.said)


@pytest.mark.parametrize("late", ["force", ""], ids=["the forces", "everything"])
def test_frame_numbers_stay_with_forces_that_are_put_back(made, table, late):
    delays = ["" if late not in name else "@0.012" for name in NAMES]
    pairs = [
        f"{name.split('_')[0]}.{name.split('_')[1]}={name}{delay}"
        for name, delay in zip(NAMES, delays, strict=True)
    ]
    columns = read_column_map(["time=time_s", "frame=frame", *pairs])
    harness = IntakeHarness(columns=columns)
    harness.send([row | {"frame": 70.0 + n} for n, row in enumerate(rows_of(table))])
    harness.intake.finish()
    detector = harness.intake._pipeline._detector

    assert detector.frame_problem == ""
    assert detector._samples.end == len(table)
    if not late:
        shown = [m.value for m in harness.strides() if not m.reasons]
        assert shown == pytest.approx([s.a2_w_kg for s in measure(made) if s.valid], rel=0.01)


def test_wrong_frame_numbers_are_told_once(table):
    harness = IntakeHarness()
    harness.send([row | {"frame": 3.0} for row in rows_of(table)])
    told = [text for text in harness.said if "frame numbers are ignored" in text]

    assert len(told) == 1
    assert "they stay as they are" in told[0]
    assert [m for m in harness.strides() if not m.reasons]


def test_stamps_of_seconds_since_1970_and_large_counts_are_kept(table, tmp_path):
    path = tmp_path / "kept.csv"
    stamps, frames = 1_763_800_000 + table[:, 0], 2.0**32 + np.arange(len(table))
    rows = rows_of(np.column_stack((stamps, table[:, 1:])))
    harness = IntakeHarness(keep=path)
    harness.send([row | {"frame": n} for row, n in zip(rows, frames, strict=True)])
    harness.intake.finish()
    harness.intake.close()
    t_s, _, kept, _ = read_signals(path)

    assert np.abs(t_s - stamps).max() < 1e-5
    assert (kept == frames).all()


def test_frame_numbers_are_kept(table, tmp_path):
    path = tmp_path / "kept.csv"
    harness = IntakeHarness(keep=path)
    harness.send(spoil_stamps(table))
    harness.intake.finish()
    harness.intake.close()
    t_s, legs, frames, _ = read_signals(path)
    again = measure_strides(t_s, legs, rate_hz=200, mass_kg=MASS, frame=frames)

    assert frames[0] == 7000
    assert [s.a2_w_kg for s in again if s.valid] == pytest.approx(
        [m.value for m in harness.strides() if not m.reasons], rel=1e-4
    )
