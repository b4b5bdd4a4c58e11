"""Files of the field: whatever kind they are, the same strides come out."""

import gzip

import numpy as np
import pytest

from rehab.gait import GaitInputError, measure_strides
from rehab.gait.__main__ import main
from rehab.gait.recordings.readers import read_any_table, read_signals
from rehab.gait.setup.check import check_setup
from rehab.gait.signals.frame_clock import find_frame_problem
from tests.gait.c3d import write_c3d
from tests.gait.walks import make_walk

RATE = 200


@pytest.fixture(scope="module")
def walk():
    return make_walk(rate_hz=RATE, jitter_s=0.0, strides=15)[0]


def write_mot(path, walk):
    names = ["time", "1_ground_force_vy", "M", "A"]
    rows = np.column_stack([walk.t_s, *walk.left])
    head = f"grf\nversion=1\nnRows={len(rows)}\nnColumns=4\nendheader\n" + "\t".join(names)
    np.savetxt(path, rows, "%.9g", "\t", header=head, comments="")


def write_visual3d(path, walk):
    head = [
        ["", "walk.c3d", "walk.c3d", "walk.c3d", "walk.c3d"],
        ["", "TIME", "FP1", "LAnkleMoment", "LAnkleAngle"],
        ["", "FRAME_NUMBERS", "FORCE", "LINK_MODEL_BASED", "LINK_MODEL_BASED"],
        ["", "ORIGINAL", "ORIGINAL", "ORIGINAL", "ORIGINAL"],
        ["ITEM", "X", "Z", "X", "X"],
    ]
    rows = np.column_stack([np.arange(1, len(walk.t_s) + 1), walk.t_s, *walk.left])
    text = "\n".join("\t".join(line) for line in head)
    np.savetxt(path, rows, "%.9g", "\t", header=text, comments="")


def write_nexus(path, walk):
    """Devices at 200 Hz and model outputs at 100 Hz, each with a head of five lines."""
    frames = np.arange(len(walk.t_s)) // 2 + 1
    with path.open("w") as file:
        file.write("Devices\n200\n,,Force Plate 1,,\nFrame,Sub Frame,Fz\n,,N\n")
        for frame, n, force in zip(frames, range(len(frames)), -walk.left[0], strict=True):
            file.write(f"{frame},{n % 2},{force:.6g}\n")
        file.write("\nModel Outputs\n100\n,,P01:LAnkleMoment,P01:LAnkleAngles\n")
        file.write("Frame,Sub Frame,X,X\n,,N.mm/kg,deg\n")
        for n in range(0, len(frames), 2):
            moment, angle = walk.left[1, n] * 1000 / 75, np.degrees(walk.left[2, n])
            file.write(f"{n // 2 + 1},0,{moment:.9g},{angle:.9g}\n")


WRITERS = {
    "walk.c3d": (
        write_c3d,
        ["time=time", "left.force=Fz1*-1", "left.moment=LAnkleMoment.X*0.001",
         "left.angle=LAnkleAngles.X*0.0174532925"],
    ),
    "walk.mot": (
        write_mot, ["time=time", "left.force=1_ground_force_vy", "left.moment=M", "left.angle=A"]
    ),
    "visual3d.txt": (
        write_visual3d,
        ["time=time", "left.force=FP1.Z", "left.moment=LAnkleMoment.X", "left.angle=LAnkleAngle.X"],
    ),
    "nexus.csv": (
        write_nexus,
        ["time=time", "left.force=Force Plate 1.Fz*-1", "left.moment=LAnkleMoment.X*0.075",
         "left.angle=LAnkleAngles.X*0.0174532925"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRITERS)
def test_the_same_strides_from_each_kind_of_file(walk, tmp_path, name):
    write, pairs = WRITERS[name]
    path = tmp_path / name
    write(path, walk)
    time_s, legs, *_ = read_signals(path, pairs=pairs)

    assert time_s == pytest.approx(walk.t_s[: len(time_s)], abs=1e-6)
    for found, given, size in zip(legs["left"][:3], walk.left, (700, 100, 0.5), strict=True):
        assert np.abs(np.asarray(found) - given[: len(time_s)]).max() < 0.05 * size


@pytest.mark.parametrize("name", WRITERS)
def test_each_kind_of_file_is_recognized(walk, tmp_path, name, capsys):
    """The check names columns, units and signs, and what it proposes measures."""
    write, _ = WRITERS[name]
    path = tmp_path / name
    write(path, walk)
    check = check_setup(read_any_table(path), 75.0)

    assert {channel for _, channel in check.proposal.guesses} == {"force", "moment", "angle"}
    assert check.valid >= 0.8 * check.strides
    assert main(["check", str(path), "--mass", "75"]) in (0, 1)
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("  python -m rehab.gait ")
    assert " --mass " in last


def test_gzipped_csv(walk, tmp_path):
    path = tmp_path / "walk.csv.gz"
    with gzip.open(path, "wt") as file:
        np.savetxt(file, np.column_stack([walk.t_s, *walk.left]), "%.9g", ",", header="t,F,M,A",
                   comments="")  # fmt: skip
    time_s, legs, *_ = read_signals(
        path, pairs=["time=t", "left.force=F", "left.moment=M", "left.angle=A"]
    )

    assert time_s == pytest.approx(walk.t_s, abs=1e-6)
    assert legs["left"].moment_nm == pytest.approx(walk.left[1], abs=1e-3)


def test_a_column_of_frame_numbers_may_be_empty(walk, tmp_path):
    path = tmp_path / "walk.csv"
    names = "time_s,left_force_n,left_moment_nm,left_angle_rad,frame"
    rows = ["".join(f"{value:.9g}," for value in row) for row in np.array([walk.t_s, *walk.left]).T]
    path.write_text("\n".join([names, *rows]) + "\n")
    t_s, legs, frames, _ = read_signals(path)

    assert find_frame_problem(t_s, frames).startswith("The frame numbers are ignored: some are")
    assert measure_strides(t_s, legs, rate_hz=RATE, mass_kg=75.0, frame=frames)


def test_frame_numbers_are_saved_with_the_signals(walk, tmp_path, capsys):
    path, saved = tmp_path / "walk.csv", tmp_path / "saved.csv"
    frames = 2.0**32 + np.arange(len(walk.t_s))
    columns = [walk.t_s, *walk.left, frames]
    np.savetxt(path, np.column_stack(columns), "%.15g", ",", header="t,Fz,M,A,Frame", comments="")
    pairs = ["time=t", "left.force=Fz", "left.moment=M", "left.angle=A"]
    assert main(["check", str(path), "--mass=75", "--save", str(saved), "--columns", *pairs]) < 2

    assert (read_signals(saved)[2] == frames).all()
    assert main(["check", str(path), "--save", str(saved), "--columns", *pairs, "frame=n"]) == 2
    assert "has no column n. It has: t, Fz" in capsys.readouterr().err


def test_markers(tmp_path):
    path = tmp_path / "walk.trc"
    lines = [
        *("PathFileType\t4", "DataRate\t...", "100\t100", "Frame#\tTime\tLANK\t\t\tRANK\t\t"),
        *("\t\tX1\tY1\tZ1\tX2\tY2\tZ2", "1\t0.00\t1\t2\t3\t4\t5\t6", "2\t0.01\t1\t2\t3\t4\t\t6"),
    ]
    path.write_text("\n".join(lines))
    table = read_any_table(path)

    assert list(table)[1:4] == ["time", "LANK.X", "LANK.Y"]
    assert table["RANK.Z"].tolist() == [6, 6]
    assert np.isnan(table["RANK.Y"][1])


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.c3d", "no c3d", "is no C3D file"),
        ("a.mot", "nonsense", "no endheader"),
        ("a.trc", "nonsense", "no marker file"),
        ("a.csv", "Devices\nfast\n,,\nFrame,Sub Frame,Fz\n,,N\n1,0,1\n", "is no rate"),
        ("a.txt", "\tf\n\tM\n\tT\n\tO\nITEM\tX\n1\t2\n", "has no TIME signal"),
    ],
)
def test_damaged_files_are_told_with_the_cure(tmp_path, name, text, message):
    if name.endswith(".c3d"):
        pytest.importorskip("ezc3d")
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(GaitInputError, match=message):
        read_any_table(path)


@pytest.mark.parametrize(
    ("heads", "column"),
    [
        ("FREQUENCY\t50\nMARKER_NAMES\tLANK\tRANK\nX\tY\tZ\tX\tY\tZ", "RANK.Z"),
        ("FREQUENCY\t50\nMARKER_NAMES\tLANK\tRANK\nFrame\tTime\tLANK X\tY\tZ\tX\tY\tZ", "RANK.Z"),
        ("NO_OF_SAMPLES\t2\nFREQUENCY\t50\nForce_X\tForce_Y\tForce_Z", "Force_Z"),
    ],
)  # fmt: skip
def test_exports_of_qualisys(tmp_path, heads, column):
    path = tmp_path / "walk.tsv"
    width = len(heads.split("\n")[-1].split("\t"))
    rows = [[n / 50 for n in range(row, row + width)] for row in range(2)]
    path.write_text("\n".join([heads, *("\t".join(map(str, row)) for row in rows)]))
    table = read_any_table(path)

    assert table[column].tolist() == [row[-1] for row in rows]
    assert np.diff(table["time"]).tolist() == pytest.approx([0.02])


def test_points_without_units_are_in_millimeters_and_no_force(tmp_path):
    """As in C3D: a marker's height must not be taken for a plate's force."""
    ezc3d = pytest.importorskip("ezc3d")
    path, (walk, _) = tmp_path / "walk.c3d", make_walk(strides=12)
    write_c3d(path, walk)
    file = ezc3d.c3d(str(path))
    file["parameters"]["POINT"]["LABELS"]["value"] = ["LTOE", "LHEE", "RTOE", "RHEE"]
    file["parameters"]["POINT"]["UNITS"]["value"] = []
    del file["data"]["meta_points"]
    file.write(str(path))
    table = read_any_table(path)
    assert {table.units[f"{label}.Z"] for label in ("LTOE", "RHEE")} == {"mm"}
