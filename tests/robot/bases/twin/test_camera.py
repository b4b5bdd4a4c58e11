"""The twin's picture: drawn beside it, where it is now, and always whole."""

import signal
import struct
import subprocess
import sys
import time
import zlib

import pytest

from robot.bases.twin.__main__ import main
from robot.bases.twin.camera import HEIGHT, WIDTH, Camera, write_png
from robot.motion.pose import HOME, Pose

pytest.importorskip("pybullet")


def read_png(data):
    """Return width, height and the rows' bytes of a PNG of ours."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    chunks, rest = {}, data[8:]
    while rest:
        (length,) = struct.unpack(">I", rest[:4])
        kind, body = rest[4:8], rest[8 : 8 + length]
        (check,) = struct.unpack(">I", rest[8 + length : 12 + length])
        assert check == zlib.crc32(kind + body)
        chunks[kind], rest = body, rest[12 + length :]
    assert list(chunks) == [b"IHDR", b"IDAT", b"IEND"]
    width, height = struct.unpack(">II", chunks[b"IHDR"][:8])
    return width, height, zlib.decompress(chunks[b"IDAT"])


def dark(data):
    """Return the columns' mean of the dark pixels: where the robot is from left to right."""
    width, height, rows = read_png(data)
    columns = []
    for row in range(height):
        line = rows[row * (4 * width + 1) + 1 : (row + 1) * (4 * width + 1)]
        columns += [n for n in range(width) if sum(line[4 * n : 4 * n + 3]) < 120]
    assert len(columns) > 500
    return sum(columns) / len(columns)


def wait_for(file, accept):
    until_s = time.monotonic() + 30
    while time.monotonic() < until_s:
        if file.exists() and accept(file.read_bytes()):
            return True
        time.sleep(0.05)
    return False


def test_pictures_are_png():
    assert read_png(write_png(2, 1, bytes(range(8)))) == (2, 1, b"\0" + bytes(range(8)))


def test_it_shows_where_the_twin_is_now(tmp_path):
    file, poses = tmp_path / "twin.png", [HOME]
    with Camera(file, lambda: poses[0]):
        assert wait_for(file, lambda _: True)
        assert read_png(file.read_bytes())[:2] == (WIDTH, HEIGHT)
        at_home = dark(file.read_bytes())
        poses[0] = Pose(0.3, 0.2, 1.0)
        assert wait_for(file, lambda data: abs(dark(data) - at_home) > 20)
    assert [path.name for path in tmp_path.iterdir()] == ["twin.png"]


def test_it_comes_and_goes_with_the_twin(tmp_path):
    file = tmp_path / "twin.png"
    with subprocess.Popen(
        [sys.executable, "-m", "robot", "twin", "--camera", str(file)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as twin:
        assert twin.stdout.readline().strip()
        assert wait_for(file, lambda _: True)
        twin.send_signal(signal.SIGTERM)
        assert twin.wait(10) == 0
        assert twin.stderr.read() == ""
        assert twin.stdout.read() == ""


@pytest.mark.parametrize("missing", ["folder", "pybullet"])
def test_what_it_needs_is_said(tmp_path, capsys, monkeypatch, missing):
    file = tmp_path / ("nowhere" if missing == "folder" else "") / "twin.png"
    if missing == "pybullet":
        monkeypatch.setattr("robot.bases.twin.__main__.find_spec", lambda _: None)
    with pytest.raises(SystemExit):
        main(["--camera", str(file)])
    said = capsys.readouterr().err
    assert missing in said
    assert ("Make it first" if missing == "folder" else "Cure") in said
