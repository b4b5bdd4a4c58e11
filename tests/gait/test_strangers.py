"""Files of labs that GARRY has never seen: one command each to the same A2."""

import numpy as np
import pytest

from rehab.gait import GaitInputError
from rehab.gait.recordings.markers import find_markers
from rehab.gait.recordings.table import Table
from rehab.gait.setup.find_columns import propose
from tests.gait.strangers import FILES, NAMES, judge, make_known_walk, write_named

pytestmark = pytest.mark.matrix


@pytest.fixture(scope="module")
def walk():
    return make_known_walk(rate_hz=100, mass_kg=75.0)


@pytest.mark.parametrize("name", FILES)
def test_from_a_stranger_s_file_to_a2(name, walk, tmp_path):
    found = judge(FILES[name](tmp_path, walk), walk, walk.mass_kg)

    assert found.valid >= 0.9 * found.clean
    assert abs(found.error) < 0.02


@pytest.mark.parametrize("name", FILES)
def test_without_a_mass(name, walk, tmp_path):
    """By the plates: A2 is as far off as they are, or the file cannot be told apart without."""
    found = judge(FILES[name](tmp_path, walk), walk)

    assert found.valid >= 0.9 * found.clean
    assert abs(found.error) < 0.05


@pytest.mark.parametrize("stride_s", [2.5, 3.2, 4.0])
def test_slow_walkers(stride_s, tmp_path):
    walk = make_known_walk(rate_hz=100, mass_kg=75.0, stride_s=stride_s, a2_w_kg=0.8)
    found = judge(write_named(tmp_path, walk, NAMES["HBM"]), walk, walk.mass_kg)

    assert found.valid >= 0.9 * found.clean
    assert abs(found.error) < 0.03


def test_of_a_plate_s_axes_the_one_that_bears_is_upward(walk):
    """Though the others have the same curve, and each may be called so."""
    columns = {"time": walk.t_s} | NAMES["HBM"].label(walk)
    for plate in (1, 2):
        up = columns[f"FP{plate}.ForY"]
        columns |= {f"FP{plate}.ForX": 0.1 * up, f"FP{plate}.ForZ": -0.4 * up}
    guesses = propose(Table(columns), walk.mass_kg).guesses

    assert {g.column for (_, c), g in guesses.items() if c == "force"} == {"FP1.ForY", "FP2.ForY"}


def test_what_has_another_unit_or_joint_is_no_channel(walk):
    """Muscles in volts, and forces in a joint, whatever their curves."""
    columns = {"time": walk.t_s} | NAMES["HBM"].label(walk)
    emg = {"EMG1": columns.pop("LAnkleFlexion.Mom"), "EMG2": columns.pop("RAnkleFlexion.Mom")}
    guesses = propose(Table(columns | emg, dict.fromkeys(emg, "V")), walk.mass_kg).guesses
    assert not [one for _, one in guesses if one == "moment"]

    forces = {f"{s}AnkleForce.X": columns.pop(f"FP{n}.ForY") for n, s in ((1, "L"), (2, "R"))}
    with pytest.raises(GaitInputError, match="no vertical force"):
        propose(Table(columns | forces), walk.mass_kg)


def test_sides_of_columns_whose_words_are_not_known(walk):
    """Nothing but the side is known of them: no leg is taken for the other one."""
    names = {"L x1": "left", "L x2": "left", "L x3": "left",
             "R x1": "right", "R x2": "right", "R x3": "right"}  # fmt: skip
    values = list(NAMES["HBM"].label(walk).values())
    rows = dict(zip(names, values, strict=True))
    guesses = propose(Table({"time": walk.t_s} | dict(reversed(rows.items()))), 75.0).guesses

    assert {(side, guess.column[0]) for (side, _), guess in guesses.items()} == {
        ("left", "L"), ("right", "R")
    }  # fmt: skip


@pytest.mark.parametrize(
    ("label", "place"),
    [
        ("LANK", ("left", "ank")), ("P1:RANK", ("right", "ank")), ("L.Ankle", ("left", "ankle")),
        ("LeftAnkleLat", ("left", "ankle")), ("l_ankle_lateral", ("left", "ankle")),
        ("ANK_R", ("right", "ank")), ("R_FAL", ("right", "fal")), ("LMED", ("left", "mm")),
        ("R.Ankle.Medial", ("right", "mm")), ("LeftKneeMed", ("left", "mek")),
        ("RTIO", ("right", "tio")), ("L_Knee_Joint_Center", ("left", "kneejointcenter")),
    ],
)  # fmt: skip
def test_markers_by_any_name(label, place):
    assert find_markers([label])[place] == label


@pytest.mark.parametrize("label", ["T10", "L", "LASI5x", "Lateral", "RLeft"])
def test_labels_that_are_no_markers_of_a_joint(label):
    places = {place for _, place in find_markers([label])}
    assert not places & {"ank", "ankle", "mm", "kne", "knee", "toe", "hee"}


FORCES = ("FP1.ForY", "FP2.ForY")


def label_by(walk, factors):
    """Return a walk's columns by HBM's names, times a factor by what a name has in it."""
    columns = {"time": walk.t_s} | NAMES["HBM"].label(walk)
    return {
        name: values * next((f for part, f in factors.items() if part in name), 1.0)
        for name, values in columns.items()
    }


def test_forces_by_body_weight_are_no_mass(walk):
    """In kN they would carry everybody's 102 kg."""
    weights = {"For": 1 / (walk.mass_kg * 9.81)}
    with pytest.raises(GaitInputError, match="give the mass"):
        propose(Table(label_by(walk, weights)))
    percent = Table(label_by(walk, {"For": 100 * weights["For"]}), dict.fromkeys(FORCES, "%BW"))
    for table in (Table(label_by(walk, weights)), percent):
        guesses = propose(table, walk.mass_kg).guesses
        assert guesses["left", "force"].factor == pytest.approx(
            1 / weights["For"] / (100 if table is percent else 1)
        )


def test_moments_by_body_weight_and_height_are_told(walk):
    """In kNm they would be a weak ankle's."""
    table = Table(label_by(walk, {"Mom": 1 / (walk.mass_kg * 9.81 * 1.75)}))
    guess = propose(table, walk.mass_kg).guesses["left", "moment"]
    assert "not by body weight and height" in guess.doubt


def test_a_marker_s_position_is_no_moment_nor_angle(walk):
    """HBM's example has markers and a plate in one table, and nothing else."""
    columns = {"TimeStamp": walk.t_s} | NAMES["HBM"].label(walk)
    markers = {"RLEK.PosX": "RAnkleFlexion.Mom", "RMT5.PosY": "RAnkleFlexion.Ang"}
    columns |= {name: columns.pop(other) for name, other in markers.items()}
    guesses = propose(Table(columns), walk.mass_kg).guesses
    assert not set(markers) & {guess.column for guess in guesses.values()}


def test_a_count_of_frames_is_no_time(walk):
    columns = {"Frame": np.arange(len(walk.t_s)) + 1.0} | NAMES["HBM"].label(walk)
    with pytest.raises(GaitInputError, match="No column is a time"):
        propose(Table(columns), walk.mass_kg)
