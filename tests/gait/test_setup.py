"""What a lab's columns are is proposed from the walk itself, and wrong set-ups are refused."""

import csv
import json

import numpy as np
import pytest

from rehab.gait import GaitInputError
from rehab.gait.__main__ import main
from rehab.gait.recordings.column_mapping import read_column_map
from rehab.gait.selfcheck.shapes import SHAPES
from rehab.gait.setup.check import check_setup, compare_with_setup
from rehab.gait.setup.report import format_arguments
from tests.gait.walks import make_walk
from tests.support.data import signals

pytestmark = pytest.mark.matrix

MASS = 75.0


@pytest.fixture(scope="module")
def walk():
    return make_walk(mass_kg=MASS, rate_hz=200)[0]


def columns_of(walk, *, force=1.0, moment=1.0, angle=1.0, time=1.0):
    names = ("Fz1", "M1", "A1"), ("Fz2", "M2", "A2")
    factors = (force, moment, angle)
    found = {"t": walk.t_s * time}
    for leg, own in zip((walk.left, walk.right), names, strict=True):
        found |= {n: row * f for n, row, f in zip(own, leg, factors, strict=True)}
    return found


def test_moore_is_recognized_by_itself():
    path = signals("moore2013_s15_pre") / "UnpertPre_data.csv"
    with path.open() as file:
        names = next(csv.reader(file))
        table = np.loadtxt(file, delimiter=",", unpack=True)
    found = check_setup(dict(zip(names, table, strict=True)))

    assert {key: guess.column for key, guess in found.proposal.guesses.items()} == {
        (side, channel): f"{side.title()}{name}"
        for side in ("left", "right")
        for channel, name in (
            ("force", "GRF_y"),
            ("moment", "AnklePlantarFlexionMoment"),
            ("angle", "AnklePlantarFlexionAngle"),
        )
    }
    assert all(guess.factor == 1 for guess in found.proposal.guesses.values())
    assert found.proposal.mass_kg == pytest.approx(79.4 * 1.03, rel=0.01)  # with what he wears
    assert found.late == 47
    assert found.lost == 0
    assert all(abs(found.timing_s[side, "moment"]) < 0.01 for side in ("left", "right"))
    assert all(0.04 < found.timing_s[side, "angle"] < 0.06 for side in ("left", "right"))


@pytest.mark.parametrize(
    ("factor", "unit", "mass_kg"), [(1, "N", None), (-1, "N", None), (0.001, "kN", MASS)]
)
def test_units_and_signs_of_force(walk, factor, unit, mass_kg):
    guess = check_setup(columns_of(walk, force=factor), mass_kg).proposal.guesses["left", "force"]

    assert guess.unit == unit
    assert guess.factor == pytest.approx(1 / factor)


@pytest.mark.parametrize(
    ("factor", "unit"), [(1 / MASS, "N/kg"), (1 / 9.81, "kgf"), (1 / 4.44822, "lbf")]
)
def test_units_of_force_that_take_the_mass(walk, factor, unit):
    found = check_setup(columns_of(walk, force=factor), MASS)

    assert found.proposal.guesses["left", "force"].unit == unit
    assert found.valid > 0.8 * found.strides


@pytest.mark.parametrize("factor", [1, -1, 1000, 1000 / MASS, 1 / MASS])
def test_units_and_signs_of_moment(walk, factor):
    guess = check_setup(columns_of(walk, moment=factor), MASS).proposal.guesses["left", "moment"]

    assert guess.factor == pytest.approx(1 / factor, rel=0.01) or "as likely" in guess.doubt


@pytest.mark.parametrize(("factor", "unit"), [(1, "rad"), (-57.29578, "°"), (1000, "mrad")])
def test_units_and_signs_of_angle(walk, factor, unit):
    guess = check_setup(columns_of(walk, angle=factor)).proposal.guesses["left", "angle"]

    assert guess.unit == unit
    assert guess.factor == pytest.approx(1 / factor)
    assert not guess.doubt
    assert not guess.is_certain  # its label says nothing


def test_times_in_milliseconds(walk):
    found = check_setup(columns_of(walk, time=1000))

    assert found.proposal.time_factor == 0.001
    assert found.proposal.rate_hz == pytest.approx(200, rel=0.01)


def test_lbf_ft_for_nm_is_doubted(walk):
    found = check_setup(columns_of(walk, moment=1 / 1.35582))

    assert any("lbf·ft" in text for text in found.findings)


def test_a_knee_is_not_taken_for_an_ankle(walk):
    columns = columns_of(walk)
    begins = np.flatnonzero((walk.left[0][1:] > 50) & (walk.left[0][:-1] <= 50))
    cycles = np.interp(np.arange(len(walk.t_s)), begins, np.arange(len(begins))) % 1
    columns["A1"] = np.interp(cycles, np.arange(100) / 100, SHAPES["knee angle"])
    with_ankle = check_setup(columns | {"ankle": walk.left[2]})

    assert with_ankle.proposal.guesses["left", "angle"].column == "ankle"
    assert ("left", "angle") not in check_setup(columns).proposal.guesses


def test_of_two_columns_that_look_alike_the_first_is_doubted(walk):
    columns = columns_of(walk)
    guess = check_setup(columns | {"A9": columns["A1"]}).proposal.guesses["left", "angle"]

    assert (guess.column, guess.doubt) == ("A1", "A9 looks the same")


@pytest.mark.parametrize("lag_s", [-0.02, 0.02])
@pytest.mark.parametrize(("row", "channel"), [(1, "moment"), (2, "angle")])
def test_each_channel_has_its_own_time_and_no_delay_is_given_as_a_cure(walk, row, channel, lag_s):
    columns = columns_of(walk)
    usual_s = check_setup(columns).timing_s["left", channel]
    name = {1: "M1", 2: "A1"}[row]
    columns[name] = np.interp(walk.t_s - lag_s, walk.t_s, columns[name])
    found = check_setup(columns)

    assert found.timing_s["left", channel] - usual_s == pytest.approx(lag_s, abs=0.004)
    assert not any("@" in text for text in found.findings)
    assert any("left moment falls" in text for text in found.findings) == (channel == "moment")


def test_what_is_proposed_measures_right(walk, tmp_path, capsys):
    path = tmp_path / "lab.csv"
    columns = columns_of(walk, force=-1, moment=1000, angle=-57.29578)
    header = ",".join(columns)
    np.savetxt(
        path, np.column_stack(list(columns.values())), "%.9g", ",", header=header, comments=""
    )
    assert main(["check", str(path)]) in (0, 1)
    arguments = format_arguments(check_setup(columns)).replace("'", "").split()
    capsys.readouterr()
    assert main([str(path), *arguments]) == 0
    assert "valid, mean A2" in capsys.readouterr().out


def test_wrong_columns_are_refused_with_what_was_seen(walk):
    found = check_setup(columns_of(walk, angle=57.29578))
    given = ["time=t", "left.force=Fz2", "left.moment=M1*-1", "left.angle=A1"]
    wrong = compare_with_setup(found, read_column_map(given))

    assert len(wrong) == 3
    assert "Fz1 looks like it, Fz2 does not" in wrong[0]
    assert "its sign is turned" in wrong[1]
    assert "it is in °. Give a factor of 0.0174533" in wrong[2]
    right = ["time=t", "left.force=Fz1", "left.moment=M1", "left.angle=A1*0.0174533"]
    assert compare_with_setup(found, read_column_map(right)) == []


def test_a_doubt_about_a_labelled_column_s_sign_does_not_let_another_column_pass(walk):
    columns = columns_of(walk, angle=57.29578)
    columns["LAnkleAngles.X"] = columns.pop("A1")  # plantarflexion, which its label counts down
    found = check_setup(columns)
    assert found.proposal.guesses["left", "angle"].doubt == "its label names the other sign"
    given = ["time=t", "left.force=Fz1", "left.moment=M1", "left.angle=M1"]
    (wrong,) = compare_with_setup(found, read_column_map(given))
    assert "LAnkleAngles.X looks like it, M1 does not" in wrong


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda c: {"t": c["t"], "noise": np.random.default_rng(0).normal(size=len(c["t"]))},
            "Walk",
        ),
        (lambda c: c | {"t": np.zeros(len(c["t"]))}, "No column is a time"),
        (lambda c: {name: c[name] for name in ("t", "Fz1", "Fz2")}, "No leg is whole"),
    ],
)
def test_what_is_not_recognized_is_told_with_the_cure(walk, change, message):
    with pytest.raises(GaitInputError, match=message):
        check_setup(change(columns_of(walk)))


def test_a_delay_is_read():
    pairs = ["time=t", "left.force=F", "left.moment=M@0.01", "left.angle=A*-1@-0.02"]
    leg = read_column_map(pairs).legs["left"]

    assert (leg["moment"].factor, leg["moment"].delay_s) == (1, 0.01)
    assert (leg["angle"].factor, leg["angle"].delay_s) == (-1, -0.02)


def test_a_delay_is_taken_out(walk, tmp_path, capsys):
    path = tmp_path / "late.csv"
    angle = np.interp(walk.t_s - 0.02, walk.t_s, walk.left[2])
    table = np.column_stack([walk.t_s, walk.left[0], walk.left[1], angle])
    np.savetxt(path, table, "%.9g", ",", header="t,F,M,A", comments="")
    pairs = ["--columns", "time=t", "left.force=F", "left.moment=M", "left.angle=A@0.02"]
    assert main([str(path), "--mass", "75", "--rate", "200", "--json", *pairs]) == 0
    found = json.loads(capsys.readouterr().out)["strides"]

    expected = walk.one_leg(look_ahead_s=0.05)
    assert [s["a2_w_kg"] for s in found] == pytest.approx([s.a2_w_kg for s in expected], rel=0.01)


def test_a_count_of_samples_is_proposed_as_such_and_never_as_time(walk):
    columns = {"FrameNumber": np.arange(len(walk.t_s), dtype=np.float64)} | columns_of(walk)
    found = check_setup(columns, MASS)

    assert (found.proposal.time, found.proposal.frame) == ("t", "FrameNumber")
    assert "frame=FrameNumber" in format_arguments(found)


def test_a_count_alone_may_be_milliseconds():
    walk, _ = make_walk(mass_kg=MASS, rate_hz=1000, jitter_s=0.0)
    columns = columns_of(walk) | {"t": np.arange(len(walk.t_s), dtype=np.float64)}

    assert check_setup(columns, MASS).proposal.time_factor == 0.001


@pytest.mark.parametrize("force", [1 / 9.81, 1 / MASS, 1 / 9.81 / MASS])
def test_a_moment_that_is_larger_than_the_force_is_none(force):
    """Of moore2013 the moment looks like a force, which in kgf is smaller."""
    path = signals("moore2013_s15_pre") / "UnpertPre_data.csv"
    with path.open() as file:
        names = next(csv.reader(file))
        table = np.loadtxt(file, delimiter=",", unpack=True)
    columns = dict(zip(names, table, strict=True))
    for name in [one for one in columns if "GRF" in one]:
        columns[name] = columns[name] * force
    guesses = check_setup(columns, MASS).proposal.guesses

    assert guesses["left", "force"].column == "LeftGRF_y"
    assert guesses["right", "moment"].column == "RightAnklePlantarFlexionMoment"


def test_a_mass_that_is_no_adults_is_doubted(walk):
    found = check_setup(columns_of(walk, force=1 / 4.44822))

    assert not found.is_certain
    assert any("lbf" in text and "give the mass" in text for text in found.findings)


@pytest.mark.parametrize(("factor", "is_told"), [(0.88, True), (0.95, False), (1.14, True)])
def test_a_mass_that_the_plates_do_not_carry_is_told(walk, factor, is_told):
    found = check_setup(columns_of(walk), MASS * factor)

    assert any("it carries" in text for text in found.findings) == is_told


def test_few_steps_on_a_treadmill_are_not_taken_for_plates_in_a_floor(walk):
    columns = columns_of(walk)
    part = walk.t_s < walk.t_s[0] + 4.0
    short = {name: values[part] for name, values in columns.items()}
    with pytest.raises(GaitInputError, match="to tell a treadmill"):
        check_setup(short, MASS)
    assert not check_setup(short, MASS, is_overground=False).proposal.is_overground


def test_a_moment_that_is_too_large_is_told_so(walk):
    found = check_setup(columns_of(walk, moment=1.7), MASS)

    assert any("times too large" in text and "usual are" in text for text in found.findings)
