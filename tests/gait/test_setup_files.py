"""Strangers' files, one command each: to A2, or to what the file lacks."""

import re
import time
from dataclasses import replace

import numpy as np
import pytest

from rehab.gait import GaitInputError
from rehab.gait.__main__ import main
from rehab.gait.recordings.readers import read_any_table
from rehab.gait.recordings.table import Table, join_tables
from rehab.gait.setup.check import check_setup
from rehab.gait.setup.find_columns import propose
from rehab.gait.setup.names import Label, read_label, read_unit
from tests.gait.walks import make_walk
from tests.support.data import signals


def lab_files(*names):
    return [str(signals("lab_files") / name) for name in names]


# Of each walk: its files, body mass if they lack it, columns of the left or right leg, A2 [W/kg].
WALKS = {
    "treadmill": (
        ["gaitalytics_treadmill_events.c3d"], [],
        ("plates.right", "RAnkleMoment.X", "RAnkleAngles.X"), (4.0, 5.8),
    ),
    "flat foot": (
        ["btk_pig_flatfoot_full.c3d"], [],
        ("plates.left", "LAnkleMoment.X", "LAnkleAngles.X"), (2.8, 3.3),
    ),
    "three plates": (
        ["btk_pig_motion3_ff.c3d"], [],
        ("plates.left", "LAnkleMoment.X", "LAnkleAnglesV.X"), (3.6, 4.5),
    ),
    "OpenSim": (
        ["g23_grf.mot", "g23_id.sto", "g23_ik.mot"], ["--mass", "72.6"],
        ("ground_force_vy", "ankle_angle_r_moment", "ankle_angle_r"), (2.1, 2.4),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WALKS)
def test_from_file_to_a2(name, capsys):
    pytest.importorskip("ezc3d")
    files, arguments, columns, (low, high) = WALKS[name]
    assert main(["check", *lab_files(*files), *arguments]) in (0, 1)
    output = capsys.readouterr()
    for column in columns:
        assert any(column in line and "sure" in line for line in output.out.splitlines())
    a2 = [float(text) for text in re.findall(r"A2 \w+ ([\d.]+) W/kg", output.out)]
    assert any(low <= one <= high for one in a2)
    assert "columns …" in output.err


@pytest.mark.parametrize(
    ("name", "lack"),
    [
        ("g23_grf.mot", "The body mass is not in this file"),
        ("g23_id.sto", "but no vertical force. Give the files that belong together"),
        ("g23_ik.mot", "but no vertical force. Give the files that belong together"),
    ],
)
def test_what_a_part_of_a_walk_lacks(name, lack, capsys):
    assert main(["check", *lab_files(name)]) == 2
    assert lack in capsys.readouterr().err


def test_files_of_one_walk_are_measured_together(capsys):
    files = lab_files("g23_grf.mot", "g23_id.sto", "g23_ik.mot")
    columns = ["time=time", "right.force=ground_force_vy", "right.moment=ankle_angle_r_moment*-1"]
    columns += ["right.angle=ankle_angle_r*-0.01745329"]
    assert main([*files, "--join", "--mass=72.6", "--overground", "--columns", *columns]) == 0
    assert "1 valid, mean A2 2.2" in capsys.readouterr().out


def test_files_that_share_no_time_are_told():
    one, other = (Table({"time": np.arange(100) / 100 + at_s}) for at_s in (0, 5))
    with pytest.raises(GaitInputError, match="a.mot 0-0.99 s, b.mot 5-5.99 s"):
        join_tables({"a.mot": one, "b.mot": other})


def test_four_hundred_columns_take_three_seconds():
    pytest.importorskip("ezc3d")
    table = read_any_table(*map(type(signals("lab_files")), lab_files(*WALKS["treadmill"][0])))
    assert len(table) > 390
    began = time.process_time()
    propose(table)
    assert time.process_time() - began < 3


@pytest.mark.parametrize(
    ("column", "channel", "side"),
    [
        ("P01:LAnkleMoment.X", "moment", "left"),  # Plug-in Gait, CGM2
        ("RAnkleAnglesV.X", "angle", "right"),
        ("RAnklePlantarFlexion.Mom", "moment", "right"),  # HBM
        ("FP1.ForY", "force", ""),
        ("L_ANKLE_MOMENT.X", "moment", "left"),  # Visual3D
        ("LEFT_ANKLE_ANGLE.X", "angle", "left"),
        ("Left Ankle Angles_Theia.X", "angle", "left"),
        ("Right Ankle Moment_X", "moment", "right"),  # Qualisys
        ("ankle_angle_r_moment", "moment", "right"),  # OpenSim
        ("/jointset/ankle_l/ankle_angle_l/value", "angle", "left"),
        ("ground_force_calcn_r_vy", "force", "right"),
        ("Force.Fz1", "force", ""),
        ("left_angle_rad", "angle", "left"),  # our own
        ("Sprunggelenk links Moment X", "moment", "left"),
        ("Vertikalkraft rechts [N]", "force", "right"),
        ("Moment de la cheville gauche", "moment", "left"),
        ("Force verticale droite", "force", "right"),
        ("Ángulo tobillo derecho", "angle", "right"),
        ("Flexo-extensión tobillo izquierdo::Y", "angle", "left"),  # iSen
    ],
)
def test_labels(column, channel, side):
    label = read_label(column)
    assert (label.channel, label.side, label.is_sagittal) == (channel, side, True)


@pytest.mark.parametrize(
    "column",
    ["LAnkleForce.X", "RKneeForce.Z", "RElbowMoment.Y", "LAbsAnkleAngle.X", "LANK.X",
     "LAnklePower.X", "subtalar_angle_r", "Moment.Mx1", "LNormalisedGRF.Z", "ground_force_px",
     "Flexo-extensión cadera izquierda::Y", "Flexo-extensión tobillo derecho (Normal):YInf",
     "Kniewinkel links"],
)  # fmt: skip
def test_labels_of_other_things(column):
    assert read_label(column) is None


def test_what_is_no_force_is_not_proposed_as_one(walk):
    """A marker's height, and what carries another mass in any unit, whatever their shape."""
    names = {"L_Fz": "Right_Heel.Z", "R_Fz": "Left_Heel.Z"}
    columns = {names.get(name, name): v for name, v in label_columns(walk).items()}
    guesses = propose(Table(columns, mass_kg=75.0)).guesses
    assert guesses["left", "force"].column in names.values()
    with pytest.raises(GaitInputError, match="but no vertical force"):
        propose(Table(columns, dict.fromkeys(names.values(), "mm"), mass_kg=75.0))
    tiny = {name: v * (3e-5 if name in names.values() else 1) for name, v in columns.items()}
    with pytest.raises(GaitInputError, match="would carry 2 kg, not 75"):
        propose(Table(tiny, mass_kg=75.0))


@pytest.mark.parametrize(
    ("unit", "largest", "is_told"),
    [("Nmm", 40, True), ("Nm/kg", 0.04, True), ("Nmm", 1400, False), ("Nm", 1.4, False),
     ("", 0.04, False)],  # without a unit it may be by body weight and height
)  # fmt: skip
def test_moments_that_were_computed_without_plates_are_told(walk, unit, largest, is_told):
    columns = {n: v for n, v in label_columns(walk).items() if "Fz" not in n}
    moments = ("LAnkleMoment", "RAnkleMoment")
    columns |= {name: columns[name] / columns[name].max() * largest for name in moments}
    with pytest.raises(GaitInputError) as told:
        propose(Table(columns, dict.fromkeys(moments, unit)))
    assert "LAnkleMoment, RAnkleMoment" in str(told.value)
    assert "LAnkleAngles, RAnkleAngles" in str(told.value)
    assert ("computed without plates: they reach 0.04 Nm/kg" in str(told.value)) is is_told
    assert ("Give the files that belong together" in str(told.value)) is not is_told


def test_markers_of_a_c3d_have_the_unit_of_lengths():
    pytest.importorskip("ezc3d")
    (path,) = map(type(signals("lab_files")), lab_files("btk_pig_motion3_ff.c3d"))
    units = read_any_table(path).units
    assert (units["LANK.X"], units["LAnkleMoment.X"]) == ("mm", "Nmm")


def test_units_and_signs_of_labels():
    assert read_unit("Fz [N]", {}) == "N"
    assert read_unit("LAnkleMoment.X", {"LAnkleMoment.X": "N.mm/kg"}) == "Nmm/kg"
    assert read_label("ankle_angle_r") == Label("angle", "right", "", -1)
    assert read_label("LeftAnklePlantarFlexionAngle").sign == 1
    assert read_label("LAnkleMoment.Y").is_sagittal is False


@pytest.fixture(scope="module")
def walk():
    return make_walk(rate_hz=200)[0]


def label_columns(walk, **changed):
    columns = {"time": walk.t_s}
    for letter, leg in (("L", walk.left), ("R", walk.right)):
        names = (f"{letter}_Fz", f"{letter}AnkleMoment", f"{letter}AnkleAngles")
        columns |= dict(zip(names, leg, strict=True))
    return columns | changed


def test_no_shape_overrules_a_label(walk):
    """A column that looks more like a channel than the one that is called so is not taken."""
    noise = np.random.default_rng(0).normal(size=len(walk.t_s))
    columns = label_columns(walk, LAnkleAngles=0.3 * noise, A1=walk.left[2])
    guess = check_setup(columns, 75.0).proposal.guesses["left", "angle"]

    assert guess.column == "LAnkleAngles"
    assert "its curve over a stride is not an ankle angle's" in guess.doubt
    assert not guess.is_certain


def test_what_a_file_says_of_units_stands(walk):
    table = Table(label_columns(walk), {"LAnkleMoment": "Nmm", "RAnkleMoment": "N.m"}, mass_kg=75.0)
    proposal = propose(table)

    assert proposal.mass_source == "file"
    assert (
        proposal.guesses["left", "moment"].doubt == "the file says Nmm, but its size is that of Nm"
    )
    assert proposal.guesses["right", "moment"].is_certain


def test_plates_of_the_other_legs_are_told(walk):
    swapped = replace(walk, left=np.array([walk.right[0], *walk.left[1:]]))
    swapped = replace(swapped, right=np.array([walk.left[0], *walk.right[1:]]))
    guesses = propose(label_columns(swapped), 75.0).guesses
    assert guesses["left", "force"].doubt == "the moments say that it is the other leg's"

    numbered = label_columns(swapped)
    columns = {{"L_Fz": "Fz1", "R_Fz": "Fz2"}.get(n, n): v for n, v in numbered.items()}
    guesses = propose(columns, 75.0).guesses
    assert guesses["left", "force"].column == "Fz2"
    assert guesses["left", "force"].is_certain
