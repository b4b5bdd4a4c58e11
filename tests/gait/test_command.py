"""``python -m rehab.gait`` on files good and bad."""

import importlib.util
import json
from unittest.mock import MagicMock, Mock

import numpy as np
import pytest

from rehab.gait import LegSamples
from rehab.gait.__main__ import main
from rehab.gait.recordings import plot
from rehab.gait.recordings.plot import compute_curves, plot_strides
from tests.gait.walks import make_walk, read_moore
from tests.support.data import signals

COLUMNS = ["time=t", "left.force=Fz", "left.moment=M*1000", "left.angle=A*-1"]


@pytest.fixture
def lab_file(tmp_path):
    """Return a recording of a lab that sends kilonewton meters and dorsiflexion."""
    walk, _ = make_walk(strides=12)
    path = tmp_path / "walk.csv"
    table = np.column_stack(
        [walk.t_s, walk.left[0], walk.left[1] / 1000, -walk.left[2], walk.right[0]]
    )
    np.savetxt(path, table, delimiter=";", header="t;Fz;M;A;Fz right", comments="", fmt="%.9f")
    return path, walk


def test_moore_is_ready_made(capsys):
    path = signals("moore2013_s15_pre") / "UnpertPre_data.csv"
    assert main([str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)

    walk, _ = read_moore()
    expected = walk.both_legs(look_ahead_s=0.05)
    assert found["mass_kg"] == 79.4
    assert found["rate_hz"] == 100
    assert [s["a2_w_kg"] for s in found["strides"]] == [s.a2_w_kg for s in expected]
    assert {s["side"] for s in found["strides"]} == {"left", "right"}
    assert found["check"]["findings"] == []


def test_columns_units_and_signs(lab_file, capsys):
    path, walk = lab_file
    arguments = [str(path), str(path), "--json", "--mass", "75", "--rate", "100"]
    assert main([*arguments, "--columns", *COLUMNS]) == 0
    first, second = [json.loads(line) for line in capsys.readouterr().out.splitlines()]

    assert first == second
    expected = walk.one_leg(look_ahead_s=0.05)
    assert [s["a2_w_kg"] for s in first["strides"]] == pytest.approx(
        [s.a2_w_kg for s in expected], rel=1e-3
    )


def test_a_table_to_read(lab_file, capsys):
    path, _ = lab_file
    assert main([str(path), "--mass", "75", "--columns", *COLUMNS[:3], "left.angle=A"]) == 0
    shown = capsys.readouterr().out

    assert "12 strides, 0 valid" in shown
    assert "The ankle brakes where most push" in shown


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--columns", *COLUMNS], "Give it in kg: --mass 75"),
        (["--mass", "0", "--columns", *COLUMNS], "Weigh the patient"),
        (["--mass", "75"], "no known layout (garry, moore2013)"),
        (["--mass", "75", "--columns", "time=t"], "at least one leg"),
        (["--mass", "75", "--columns", "time=t", "left.force=Fz"], "no moment and no angle"),
        (["--mass", "75", "--columns", "zeit=t"], "'zeit=t' maps no column"),
        (["--mass", "75", "--columns", "time=T", *COLUMNS[1:]], "has no column T. It has: t, Fz"),
    ],
)
def test_errors_say_the_cure(lab_file, capsys, arguments, message):
    path, _ = lab_file
    assert main([str(path), *arguments]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty. Export it again"),
        ("t,Fz,M,A\n", "no samples"),
        ("t,Fz,M,A\n0,x,1,1\n1,y,1,1\n", "holds no numbers"),
        ("t,Fz,M,A\n1,1,1,1\n1,1,1,1\n", "times of the samples do not go on"),
    ],
)
@pytest.mark.filterwarnings("ignore:Empty input|genfromtxt")
def test_files_without_samples(tmp_path, capsys, text, message):
    path = tmp_path / "empty.csv"
    path.write_text(text)
    columns = ["--columns", *COLUMNS] if text else []
    assert main([str(path), "--mass", "75", *columns]) == 2
    assert message in capsys.readouterr().err


def test_a_missing_file(capsys):
    assert main(["nowhere.csv"]) == 2
    assert "nowhere.csv" in capsys.readouterr().err


def test_plot(lab_file, tmp_path, capsys):
    path, _ = lab_file
    picture = tmp_path / "out.png"
    result = main([str(path), "--mass", "75", "--plot", str(picture), "--columns", *COLUMNS])
    if importlib.util.find_spec("matplotlib") is None:
        assert result == 2
        assert "pip install matplotlib" in capsys.readouterr().err
    else:
        assert result == 0
        assert picture.read_bytes().startswith(b"\x89PNG")


def test_each_panel_of_a_plot_says_which_leg_and_what(monkeypatch, tmp_path):
    walk, _ = make_walk(strides=6)
    drawn: list[list[Mock]] = []

    def subplots(rows, columns, **_):
        panel = {"get_ylim.return_value": (0, 1)}
        drawn.extend([Mock(**panel) for _ in range(columns)] for _ in range(rows))
        return MagicMock(), np.array(drawn)

    monkeypatch.setattr(plot, "load_pyplot", lambda: MagicMock(subplots=subplots))
    legs = {"left": LegSamples(*walk.left), "right": LegSamples(*walk.right)}
    strides = list(walk.one_leg())
    plot_strides(tmp_path / "p.png", walk.t_s, legs, strides, rate_hz=100, mass_kg=walk.mass_kg)
    labels = [panels[0].set_ylabel.call_args.args[0] for panels in drawn]
    rows = (*plot.ROWS, "A2 [W/kg]")
    assert labels == [f"{side}\n{row}" for side in legs for row in rows]


def test_what_is_plotted_is_what_was_measured():
    """The drawn power peaks where A2 was measured, within what drawing takes off."""
    walk, _ = make_walk(strides=12)
    curves = compute_curves(LegSamples(*walk.left), 100, walk.mass_kg)
    for stride in walk.one_leg(look_ahead_s=0.05):
        at = int(np.searchsorted(walk.t_s, stride.a2_time_s))
        assert curves[3][at - 3 : at + 4].max() == pytest.approx(stride.a2_w_kg, rel=0.03)
