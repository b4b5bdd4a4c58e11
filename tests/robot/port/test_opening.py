"""Opening a port: for us alone, against both kinds of locks, and under whatever name it has."""

import contextlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from robot.port.opening import LOOK_EVERY_S, PortOpener, send_stops
from tests.support.fake_kobuki import STOP_FRAME, FakeKobuki

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pty, no such locks")

# As another program does it: argument 1 is the port, argument 2 how it locks.
LOCKING = """
import fcntl, os, sys
port = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
lock = {"fcntl": fcntl.lockf, "flock": fcntl.flock}[sys.argv[2]]
try:
    lock(port, fcntl.LOCK_EX | fcntl.LOCK_NB)
    print("locked", flush=True)
    sys.stdin.read()
except OSError:
    print("refused", flush=True)
"""


@contextlib.contextmanager
def another_program(url, how):
    """Give what another program says that opens and locks a port."""
    process = subprocess.Popen(
        [sys.executable, "-c", LOCKING, url, how],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process.stdout.readline().strip()
    finally:
        process.communicate()


@pytest.fixture
def kobuki():
    with FakeKobuki() as kobuki:
        yield kobuki


@pytest.mark.parametrize("how", ["fcntl", "flock"])
def test_a_port_that_another_program_has_locked_is_refused(kobuki, how):
    with another_program(kobuki.url, how) as said:
        assert said == "locked"
        with pytest.raises(OSError, match=r"another program has locked|exclusively lock"):
            PortOpener(kobuki.url, 115200)()
    PortOpener(kobuki.url, 115200)().close()


@pytest.mark.parametrize("how", ["fcntl", "flock"])
def test_a_port_that_is_ours_cannot_be_locked_by_another(kobuki, how):
    port = PortOpener(kobuki.url, 115200)()
    with another_program(kobuki.url, how) as said:
        assert said == "refused"
    port.close()
    with another_program(kobuki.url, how) as said:
        assert said == "locked"


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells")
def test_a_real_port_cannot_even_be_opened(kobuki, monkeypatch):
    import fcntl
    import termios

    monkeypatch.setattr("robot.port.opening.PTYS", ("/nowhere",))
    port: Any = PortOpener(kobuki.url, 115200)()
    exclusive = 0x80045440  # TIOCGEXCL
    assert fcntl.ioctl(port.fileno(), exclusive, b"\0" * 4) == b"\1\0\0\0"
    Path(kobuki.url).chmod(0o666)
    writing = ["/bin/sh", "-c", 'printf moves > "$0"', kobuki.url]
    user = None if os.getuid() else 65534  # a superuser is not refused
    said = subprocess.run(writing, capture_output=True, text=True, cwd="/", user=user).stderr
    assert "busy" in said.lower()
    fcntl.ioctl(port.fileno(), termios.TIOCNXCL)
    port.close()


def test_a_kobuki_is_found_when_it_is_plugged_in_under_another_name():
    now_s, names = 100.0, ["/dev/ttyUSB0"]
    opener = PortOpener("", 115200, find=lambda: names[-1], monotonic=lambda: now_s)
    assert opener.url == "/dev/ttyUSB0"
    names.append("/dev/ttyUSB1")
    assert opener.url == "/dev/ttyUSB0"  # it has looked just now
    now_s += LOOK_EVERY_S
    assert opener.url == "/dev/ttyUSB1"
    assert PortOpener("COM3", 115200, find=lambda: names[-1]).url == "COM3"


def test_stops_without_a_process(kobuki, tmp_path):
    send_stops(PortOpener(kobuki.url, 115200), STOP_FRAME)
    kobuki.until(lambda: len(kobuki.orders) == 3)
    send_stops(PortOpener(str(tmp_path / "nothing"), 115200), STOP_FRAME)  # raises nothing
