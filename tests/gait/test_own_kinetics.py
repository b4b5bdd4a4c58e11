"""Ankle moment and angle computed from plates and markers, against what the files' systems made."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.signal import butter, filtfilt

from rehab.gait import LegSamples, measure_strides
from rehab.gait.recordings.ankle import JOINT_AHEAD_M, compute_ankle
from rehab.gait.recordings.columns import MARKED, find_layout, find_required, read_column_map
from rehab.gait.recordings.readers import read_any_table
from rehab.gait.setup.check import check_setup
from tests.gait.corpus import find_clean, open_corpus, read_lab_file
from tests.sources.intake_harness import IntakeHarness

ezc3d = pytest.importorskip("ezc3d")

FILES = {
    "gaitalytics treadmill": "gaitalytics_treadmill_events.c3d",
    "BTK flatfoot": "btk_pig_flatfoot_full.c3d",
    "BTK motion3": "btk_pig_motion3_ff.c3d",
}


@dataclass(frozen=True)
class Comparison:
    """Of clean strides: the moment's rms distance in stance [Nm/kg], that of the file's moment from
    its own curve below 6 Hz, and A2 by the file's own power and by its moment and angle (ratios).
    """

    rms: list[float]
    noise: list[float]
    by_power: list[float]
    by_moment: list[float]


def own_legs(table):
    return {
        side: LegSamples(
            table[f"plates.{side}"], table[f"own.{side}_moment_nm"], table[f"own.{side}_angle_rad"]
        )
        for side in ("left", "right")
    }


def compare(name: str) -> Comparison:
    walk = open_corpus(name)
    own = replace(walk, legs=own_legs(read_any_table(read_lab_file(FILES[name]))))
    strides = own.measure()
    b, a = butter(2, 6 / (walk.rate_hz / 2))
    found = Comparison([], [], [], [])
    for one in find_clean(walk):
        part = slice(*np.searchsorted(walk.t_s, (one.begin_s, one.end_s)))
        theirs = np.asarray(walk.legs[one.side].moment_nm) / walk.mass_kg
        ours = np.asarray(own.legs[one.side].moment_nm) / walk.mass_kg
        found.rms.append(float(np.sqrt(np.nanmean((ours - theirs)[part] ** 2))))
        found.noise.append(float(np.sqrt(np.mean((theirs - filtfilt(b, a, theirs))[part] ** 2))))
        ends = [abs(s.terminal_contact_s - one.end_s) if s.side == one.side else 9 for s in strides]
        a2 = strides[int(np.argmin(ends))].a2_w_kg
        found.by_power.append(a2 / one.file_a2_w_kg - 1)
        found.by_moment.append(a2 / one.a2_w_kg - 1)
    return found


@pytest.mark.parametrize(
    ("name", "most_rms", "by_power", "by_moment"),
    [
        ("BTK motion3", 0.08, (-0.08, 0.0), (-0.25, -0.2)),
        ("BTK flatfoot", 0.08, (-0.15, -0.1), (-0.02, 0.02)),
        # Its own moment scatters by 0.1 Nm/kg, and its right ankle's angle is 1.3 times that
        # between its own foot's and shank's markers.
        ("gaitalytics treadmill", 0.17, (-0.25, -0.15), (-0.22, -0.15)),
    ],
)
def test_against_the_files_own_moment_and_power(name, most_rms, by_power, by_moment):
    found = compare(name)
    print(
        f"\n{name}: {len(found.rms)} strides, moment {np.median(found.rms):.3f} Nm/kg rms (file's "
        f"own noise {np.median(found.noise):.3f}), A2 {np.median(found.by_power):+.0%} by the "
        f"file's power, {np.median(found.by_moment):+.0%} by its moment and angle"
    )
    assert max(found.rms) < most_rms
    assert by_power[0] < np.median(found.by_power) < by_power[1]
    assert by_moment[0] < np.median(found.by_moment) < by_moment[1]


def test_a_file_without_moments_is_measured_from_its_markers(tmp_path):
    """One command: plates and markers are enough."""
    table = read_any_table(read_lab_file(FILES["BTK motion3"]))
    for name in [n for n in table if "Ankle" in n]:
        del table[name]
    check = check_setup(table)
    guesses = {key: guess.column for key, guess in check.proposal.guesses.items()}
    assert guesses["left", "moment"] == "own.left_moment_nm"
    assert guesses["right", "angle"] == "own.right_angle_rad"
    assert check.valid >= 2
    whole = check_setup(read_any_table(read_lab_file(FILES["BTK motion3"])))
    assert whole.proposal.guesses["left", "moment"].column == "LAnkleMoment.X"


def test_a_c3d_whose_second_axis_is_upward_gets_its_plates(tmp_path):
    path = read_lab_file(FILES["BTK motion3"])
    file, turned = ezc3d.c3d(str(path)), tmp_path / "y_up.c3d"
    points = file["data"]["points"]
    points[:3] = points[[1, 2, 0]]  # x, y, z become z, x, y
    corners = file["parameters"]["FORCE_PLATFORM"]["CORNERS"]["value"]
    corners[:] = np.array(corners)[[1, 2, 0]]
    file.write(str(turned))
    expected, found = read_any_table(path), read_any_table(turned)
    for name in ("plates.left", "plates.right", "own.left_moment_nm", "own.left_angle_rad"):
        assert found[name] == pytest.approx(expected[name], abs=1e-3, nan_ok=True)


def sagittal_rows(count=400, rate_hz=100.0):
    """Return a leg of known statics: the foot tips about its toe under a leaning force."""
    t_s = np.arange(count) / rate_hz
    rows = {
        "force": 300 + 50 * np.sin(t_s),
        "forward": 40 * np.cos(t_s),
        "cop": 0.1 + 0.02 * t_s,
        "ankle_forward": 0.05 * np.sin(t_s),
        "ankle_up": 0.08 + 0.01 * t_s,
        "knee_forward": 0.05 * np.sin(t_s) + 0.4 * np.sin(0.3 * t_s),
        "knee_up": 0.08 + 0.01 * t_s + 0.4 * np.cos(0.3 * t_s),
        "toe_forward": 0.05 * np.sin(t_s) + 0.15 * np.cos(0.2 * t_s),
        "toe_up": 0.08 + 0.01 * t_s - 0.15 * np.sin(0.2 * t_s),
    }
    return t_s, rows


def test_moment_and_angle_by_hand():
    t_s, leg = sagittal_rows()
    moment, angle = compute_ankle(leg)
    lever = leg["cop"] - leg["ankle_forward"] - JOINT_AHEAD_M
    assert moment == pytest.approx(lever * leg["force"] + leg["ankle_up"] * leg["forward"])
    # The shank leans forward by 0.3 rad/s and the foot plantarflexes by 0.2 rad/s.
    assert angle == pytest.approx(np.pi / 2 - 0.3 * t_s + 0.2 * t_s)


def test_columns_of_markers_take_the_place_of_moment_and_angle():
    names = [
        f"left_{name}_n" if name in {"force", "forward"} else f"left_{name}_m" for name in MARKED
    ]
    assert find_required(MARKED) == MARKED
    assert find_required((*MARKED, "moment", "angle")) == ("force", "moment", "angle")
    assert set(find_layout(["time_s", *names]).legs["left"]) == set(MARKED)
    with pytest.raises(ValueError, match=r"no toe_up\. Map left\.toe_up=COLUMN"):
        read_column_map(["time=t", *(f"left.{name}=c" for name in MARKED[:-1])])


@pytest.mark.parametrize("chunk", [7, 50])
def test_streamed_markers_give_the_strides_of_the_file(chunk, tmp_path):
    """By frame: the same numbers, whatever the chunks."""
    walk = open_corpus("BTK motion3")
    table = read_any_table(read_lab_file(FILES["BTK motion3"]))
    legs = own_legs(table)
    expected = measure_strides(
        walk.t_s, legs, rate_hz=1000.0, mass_kg=74.0, look_ahead_s=0.05, is_overground=True
    )
    # A leg whose moment and angle come out as those: a foot of 1 m that turns about a fixed ankle.
    rows = {"time_s": walk.t_s}
    for side, leg in legs.items():
        up = np.asarray(leg.force_n)
        moment, angle = np.asarray(leg.moment_nm), np.asarray(leg.angle_rad)
        with np.errstate(divide="ignore", invalid="ignore"):
            cop = np.where(up >= 40, moment / up, 0.0) + JOINT_AHEAD_M
        still = np.zeros(len(up))
        values = (up, still, cop, still, still, still, still + 1, np.sin(angle), np.cos(angle))
        for name, value in zip(MARKED, values, strict=True):
            unit = "n" if name in {"force", "forward"} else "m"
            rows[f"{side}_{name}_{unit}"] = value
    harness = IntakeHarness(mass_kg=74.0, rate_hz=1000.0, is_overground=True, keep=tmp_path / "k")
    columns = np.column_stack(list(rows.values()))
    harness.send([dict(zip(rows, row, strict=True)) for row in columns.tolist()], chunk)
    harness.intake.finish()
    harness.intake.close()
    found = harness.strides()
    assert [one.reasons for one in found] == [one.reasons for one in expected]
    assert [one.value for one in found] == pytest.approx(
        [one.a2_w_kg for one in expected], rel=1e-6
    )
    assert {"left_cop_m", "left_moment_nm"} <= set((tmp_path / "k").read_text()[:600].split(","))
