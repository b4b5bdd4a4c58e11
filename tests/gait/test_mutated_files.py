"""Files that are damaged in any way give an error that names the cure, and no traceback."""

import gzip
import os
import random
import re
import sys
import traceback

import numpy as np
import pytest

from rehab.gait.__main__ import main
from tests.gait.c3d import write_c3d
from tests.gait.walks import make_walk

SECONDS = 20  # of processor for a file of ten strides
CELLS = ("", "nan", "inf", "-1e308", "1e-320", "0", "x", "1,5", "9" * 400, '"', "\0", "\t", "é")


def mutate_text(text, chance):
    """Return a text with a few of its lines or cells changed."""
    lines = text.split("\n")
    for _ in range(chance.choice((1, 1, 3, 30))):
        # Heads are short and decide most.
        at = chance.randrange(min(len(lines), chance.choice((8, len(lines)))))
        line = lines[at]
        kind = chance.randrange(7)
        if kind == 0:
            del lines[at : at + chance.choice((1, 2, 200))]
        elif kind == 1:
            lines.insert(at, chance.choice(lines))
        elif kind == 2:
            cells = re.split(r"([,\t])", line)
            cells[chance.randrange(len(cells))] = chance.choice(CELLS)
            lines[at] = "".join(cells)
        elif kind == 3:
            lines[at] = line[: chance.randrange(len(line) + 1)]
        elif kind == 4:
            place = chance.randrange(len(line) + 1)
            lines[at] = line[:place] + chr(chance.randrange(1, 300)) + line[place:]
        elif kind == 5:  # a whole column
            column, cell = chance.randrange(6), chance.choice(CELLS)
            for n, row in enumerate(lines[at:], at):
                cells = re.split(r"([,\t])", row)
                if len(cells) > 2 * column:
                    cells[2 * column] = cell
                    lines[n] = "".join(cells)
        else:
            lines = lines[: at + 1]
        lines = lines or [""]
    return "\n".join(lines)


def mutate_bytes(data, chance):
    """Return bytes with a few of them changed, moved or gone."""
    found = bytearray(data)
    for _ in range(chance.choice((1, 2, 8, 60))):
        at = chance.randrange(min(len(found), chance.choice((512, 4096, len(found)))))
        kind = chance.randrange(8)
        if kind == 0:
            del found[at : at + chance.choice((1, 7, 512, len(found)))]
        elif kind == 1:
            found[at:at] = bytes(chance.randrange(256) for _ in range(5))
        else:
            found[at] = chance.choice((0, 1, 127, 128, 255, chance.randrange(256)))
        if not found:
            return b""
    return bytes(found)


def write_walks(folder):
    """Write one walk as each kind of file; return the paths."""
    walk, _ = make_walk(rate_hz=100, jitter_s=0.0, strides=10)
    rows = np.column_stack([walk.t_s, *walk.left, *walk.right])
    names = ["time", "L_Fz", "LAnkleMoment", "LAnkleAngles", "R_Fz", "RAnkleMoment", "RAnkleAngles"]
    heads = {
        "a.csv": ",".join(names),
        "a.mot": "a\nversion=1\nnRows=1\ninDegrees=no\nendheader\n" + "\t".join(names),
        "a.sto": "a\nendheader\n" + "\t".join(names),
        "a.trc": "PathFileType\nDataRate\n100\nFrame#\tTime\tLANK\tRANK\n\tX1\tY1\tZ1\tX2\tY2\tZ2",
        "a.tsv": "NO_OF_FRAMES\t1\nFREQUENCY\t100\nMARKER_NAMES\tA\tB\n" + "\t".join(names),
        "v.txt": "\tw\tw\tw\n\tTIME\tFP1\tLAnkleMoment\tLAnkleAngle\tFP2\tRAnkleMoment\tRAnkleAngle"
        "\n\tF\tF\n\tO\tO\nITEM\tX\tZ\tX\tX\tZ\tX\tX",
        "n.csv": "Devices\n100\n,,Force Plate 1\nFrame,Sub Frame,Fz\n,,N",
    }
    for name, head in heads.items():
        comma = "," if name.endswith(".csv") else "\t"
        counted = np.column_stack([np.arange(len(rows)), rows])
        table = {"a.trc": counted, "v.txt": counted, "n.csv": counted[:, [0, 0, 2]]}
        np.savetxt(folder / name, table.get(name, rows), "%.6g", comma, header=head, comments="")
    (folder / "a.csv.gz").write_bytes(gzip.compress((folder / "a.csv").read_bytes()))
    write_c3d(folder / "a.c3d", walk)
    return sorted(folder.iterdir())


def run_apart(path, log):
    """Check a file in a process of its own; return how it ended, and what it wrote.

    Binary files go to a parser in C++, which may end its process.
    """
    child = os.fork()
    if not child:
        with log.open("w") as file:
            sys.stdout = sys.stderr = file
            status = 99
            try:
                status = main(["check", str(path), "--mass", "75", "--bounded"])
            except SystemExit:
                status = 98
            except BaseException:
                traceback.print_exc(file=file)
            file.flush()
            os._exit(status)
    return os.waitpid(child, 0)[1], log.read_text()


def check_mutated(folder, count, seed):
    pytest.importorskip("ezc3d")
    files = [(path, path.read_bytes()) for path in write_walks(folder)]
    chance = random.Random(seed)
    assert all(run_apart(path, folder / "log")[0] in (0, 256, 512) for path, _ in files)
    for number in range(count):
        path, data = files[number % len(files)]
        if path.suffix in {".c3d", ".gz"} or chance.random() < 0.1:
            data = mutate_bytes(data, chance)
        else:
            encoding = chance.choice(("utf-8", "utf-8", "latin-1", "utf-16"))
            data = mutate_text(data.decode(), chance).encode(encoding, errors="replace")
        path.write_bytes(data)
        status, said = run_apart(path, folder / "log")
        assert status in (0, 256, 512), f"{path.name}, mutation {number} of seed {seed}: {said}"
        assert status != 512 or re.search(r"[.!?)]\s*$", said), said
        assert "codec can't" not in said, said


@pytest.mark.timeout(600)
def test_files_that_are_damaged(tmp_path):
    check_mutated(tmp_path, 60, 1)


@pytest.mark.long
@pytest.mark.timeout(900)
def test_two_thousand_files_that_are_damaged(tmp_path):
    check_mutated(tmp_path, 2000, 2)
