"""Text files of labs in the encodings that programs save them in."""

import gzip

import numpy as np
import pytest

from rehab.gait.__main__ import main
from rehab.gait.recordings.readers import read_any_table
from rehab.gait.strides import GaitInputError
from tests.gait.walks import make_walk

NAMES = ["Zeit (s)", "Kraft links", "Knöchel (°)", "Knöchelmoment"]
# Excel's CSV is Windows-1252 and its “Unicode text” UTF-16; others leave the mark out.
ENCODINGS = ["utf-8", "utf-8-sig", "latin-1", "cp1252", "utf-16", "utf-16-le", "utf-16-be"]
HEADS = {
    "a.csv": ",".join(NAMES),
    "a.mot": "Gelöst\nendheader\n" + "\t".join(name.replace(" ", "_") for name in NAMES),
    "a.tsv": "NO_OF_FRAMES\t1\nDESCRIPTION\tKnöchel\nFREQUENCY\t100\n" + "\t".join(NAMES),
    "v.txt": "\tGänge\n\tTIME\tKnöchel\tb\tc\n\tF\n\tO\nITEM\tX\tX\tX\tX",
    "n.csv": "Devices\n100\n,,Knöchel\nFrame,Sub Frame,Fz\n,,N",
}


def make_text(name):
    """Return a file of a lab of ten samples, as text."""
    comma = "," if name.endswith(".csv") else "\t"
    rows = [[n, n / 100, n % 3, n * 2.5, 1] for n in range(10)]
    lines = [comma.join(map(str, row if name == "v.txt" else row[1:])) for row in rows]
    if name == "n.csv":
        lines = [f"{n},0,{n * 2.5}" for n in range(10)]
    return "\n".join([HEADS[name], *lines]) + "\n"


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("name", HEADS)
def test_a_file_is_read_in_any_encoding(tmp_path, name, encoding):
    (tmp_path / name).write_text(make_text(name), encoding="utf-8")
    expected = read_any_table(tmp_path / name)
    assert any("Knöchel" in column for column in expected)
    (tmp_path / name).write_text(make_text(name), encoding=encoding)
    read = read_any_table(tmp_path / name)
    assert list(read) == list(expected)
    for column, values in expected.items():
        np.testing.assert_array_equal(read[column], values)


@pytest.mark.parametrize("encoding", ["latin-1", "utf-16"])
def test_a_gzipped_file_is_read_in_any_encoding(tmp_path, encoding):
    file = tmp_path / "a.csv.gz"
    file.write_bytes(gzip.compress(make_text("a.csv").encode(encoding)))
    assert list(read_any_table(file)) == NAMES


def test_a_letter_late_in_a_long_file_decides_as_well(tmp_path):
    file = tmp_path / "a.csv"
    text = "time,value,note\n" + "0.01,2,a\n" * 300_000
    file.write_bytes(text.encode() + "0.02,2,Knöchel\n".encode("latin-1"))
    assert len(read_any_table(file)["value"]) == 300_001


@pytest.mark.parametrize("encoding", ["latin-1", "utf-16"])
def test_a_walk_is_checked_in_any_encoding(tmp_path, encoding, capsys):
    walk, _ = make_walk(rate_hz=100, jitter_s=0.0, strides=10)
    names = ["time", "L_Fz", "LAnkleMoment", "LAnkleAngles", "R_Fz", "RAnkleMoment", "RAnkleAngles"]
    rows = np.column_stack([walk.t_s, *walk.left, *walk.right])
    said = []
    for each in ("utf-8", encoding):
        file = tmp_path / "walk.csv"
        head = ",".join([*names, "Knöchel (°)"])
        rows_ = "\n".join(",".join(f"{cell:.6g}" for cell in [*row, 0.0]) for row in rows)
        file.write_text(f"{head}\n{rows_}\n", encoding=each)
        main(["check", str(file), "--mass", "75"])
        said.append(capsys.readouterr().out)
    assert said[0] == said[1]
    assert "valid" in said[0]


@pytest.mark.parametrize(
    "data",
    [bytes(range(256)) * 40, b"\xff\xfe\x00", b"\x00" * 5000, b"PK\x03\x04" + b"\x00\x07" * 99],
)
@pytest.mark.parametrize("name", ["a.csv", "a.mot", "a.trc", "a.tsv", "a.txt"])
def test_what_is_no_text_is_said_in_a_sentence(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(GaitInputError) as refused:
        read_any_table(tmp_path / name)
    words = str(refused.value)
    assert words.endswith(".")
    assert not any(jargon in words for jargon in ("codec", "byte", "null", "NUL", "0x")), words


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_decimal_commas(tmp_path, delimiter):
    path = tmp_path / "walk.csv"
    lines = ("Zeit [ms],Kraft", "0,5;-1,25e2", "1,5;7")
    path.write_text("\n".join(lines).replace(",Kraft", ";Kraft").replace(";", delimiter))
    table = read_any_table(path)
    assert {name: list(values) for name, values in table.items()} == {
        "Zeit [ms]": [0.5, 1.5],
        "Kraft": [-125.0, 7.0],
    }


PLAIN = "time,L_Fz,L_Ank\n0.01,1.5,2\n0.02,-2.5,3\n0.03,,4\n"
DIALECTS = {
    "units": PLAIN.replace("L_Ank\n", "L_Ank\ns,N,deg\n"),
    "above": "Subject: P01, male\nDate: 2026-01-01\n\n" + PLAIN,
    "above, padded": "P01,,\n" + PLAIN,
    "comment": "# exported\n" + PLAIN,
    "Excel's": "sep=;\n" + PLAIN.replace(",", ";").replace(".", ","),
    "quoted": "\n".join(
        ",".join(f'"{cell}"' for cell in line.split(",")) for line in PLAIN.split("\n")[:-1]
    ),
    "quoted, decimal commas": "time,L_Fz,L_Ank\n" + "\n".join(
        ",".join(f'"{cell.replace(".", ",")}"' for cell in line.split(","))
        for line in PLAIN.split("\n")[1:-1]
    ),
    "bars": PLAIN.replace(",", "|"),
    "blanks": PLAIN.replace(",,", ",nan,").replace(",", "  "),
}  # fmt: skip


@pytest.mark.parametrize("name", DIALECTS)
def test_a_table_is_read_in_any_dialect(tmp_path, name):
    path = tmp_path / "walk.csv"
    path.write_text(DIALECTS[name])
    table = read_any_table(path)
    expected = {"time": [0.01, 0.02, 0.03], "L_Fz": [1.5, -2.5, np.nan], "L_Ank": [2, 3, 4]}
    assert list(table) == list(expected)
    for column, values in expected.items():
        np.testing.assert_array_equal(table[column], values)
    assert table.units.get("L_Ank", "") == ("deg" if name == "units" else "")
