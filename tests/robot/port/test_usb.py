"""Diagnosis the port of a Kobuki, and `python -m robot doctor` on it."""

import sys
import threading

import pytest

from robot import doctor
from robot.__main__ import main
from robot.port import usb
from robot.port.usb import Usb, check_port, find_port
from tests.support.fake_kobuki import FakeKobuki

KOBUKI = Usb("/dev/ttyUSB3", 0x0403, 0x6001, "kobuki_A505QO28")
CABLE = Usb("/dev/ttyUSB0", 0x0403, 0x6001, "FT0ABC")  # any FTDI cable has the same chip

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="no pty")


def cures(port, usbs, **options):
    return [found.cure for found in check_port(str(port), usbs, **options) if found.cure]


@pytest.mark.parametrize(
    ("usbs", "port"),
    [([CABLE, KOBUKI], "/dev/ttyUSB3"), ([CABLE], "/dev/kobuki"), ([], "/dev/kobuki")],
    ids=["a Kobuki", "another cable", "nothing"],
)
def test_which_port(monkeypatch, usbs, port):
    monkeypatch.delenv("GARRY_ROBOT_PORT", raising=False)
    monkeypatch.setattr(usb, "list_ports", lambda: usbs)
    assert find_port() == port
    monkeypatch.setenv("GARRY_ROBOT_PORT", "socket://127.0.0.1:9")
    assert find_port() == "socket://127.0.0.1:9"


@pytest.fixture
def drivers(tmp_path):
    (tmp_path / "drivers" / "ftdi_sio").mkdir(parents=True)
    chip = tmp_path / "devices" / "ttyUSB3"
    chip.mkdir(parents=True)
    (chip / "latency_timer").write_text("1\n")
    return tmp_path


@pytest.fixture
def port(tmp_path):
    port = tmp_path / "ttyUSB3"
    port.touch()
    return port


def test_nothing_is_wrong(port, drivers):
    assert cures(port, [KOBUKI], drivers=drivers) == []
    assert cures("socket://127.0.0.1:9", []) == []


def test_a_chip_that_waits(port, drivers):
    (drivers / "devices" / "ttyUSB3" / "latency_timer").write_text("16\n")
    (cure,) = cures(port, [KOBUKI], drivers=drivers)
    assert cure.startswith(f"echo 1 | sudo tee {drivers}/devices/ttyUSB3/latency_timer")


def test_nothing_is_plugged_in(tmp_path, drivers):
    first, second = cures(tmp_path / "kobuki", [], drivers=drivers, system="linux")
    assert "Switch it on" in first
    assert "Plug the base in" in second


def test_no_driver(tmp_path):
    (_, cure) = cures(tmp_path / "kobuki", [], drivers=tmp_path, system="linux")
    assert "modprobe ftdi_sio" in cure


def test_no_rule(tmp_path, drivers):
    (cure,) = cures(tmp_path / "kobuki", [KOBUKI], drivers=drivers)
    assert "--port /dev/ttyUSB3" in cure
    assert usb.UDEV_RULE in cure


def test_no_permission(port, drivers, monkeypatch):
    monkeypatch.setattr("os.access", lambda *_: False)
    (cure,) = cures(port, [KOBUKI], drivers=drivers)
    assert "usermod -aG dialout" in cure


def test_windows_has_no_devices_to_look_at():
    assert cures("COM3", [Usb("COM3", 0x0403, 0x6001, "kobuki_A5")], system="win32") == []


@POSIX
def test_the_rule_in_the_documentation_is_the_one_that_is_told():
    from pathlib import Path

    assert usb.UDEV_RULE in (Path(__file__).parents[3] / "docs" / "robot.md").read_text("utf-8")


@POSIX
@pytest.mark.server
def test_the_doctor_listens_to_a_base(capsys):
    with FakeKobuki() as kobuki:
        main(["doctor", "--port", kobuki.url])
        told = capsys.readouterr().out
        assert "ok  It tells" in told
        assert "A pause of 20 ms took up to" in told
        assert "ok  Firmware 1.2.0." in told
        assert "ok  Battery 16.0 V." in told
        kobuki.bumper, kobuki.battery, kobuki.version = 1, 134, (2, 0, 0)
        assert main(["doctor", "--port", kobuki.url]) == 1
        told = capsys.readouterr().out
        assert "!!  It feels: bump." in told
        assert "!!  Battery 13.4 V." in told
        assert "!!  Firmware 2.0.0." in told
        kobuki.is_mute = True
        assert main(["doctor", "--port", kobuki.url]) == 1
        assert "nothing that a Kobuki would say" in capsys.readouterr().out
        assert not any(speed for _, speed, _ in kobuki.orders)


@POSIX
@pytest.mark.server
def test_the_doctor_and_a_port_that_is_taken_or_not_there(capsys, tmp_path):
    from tests.support.port_process import owning

    assert main(["doctor", "--port", str(tmp_path / "kobuki")]) == 1
    assert "cannot be opened" in capsys.readouterr().out
    with FakeKobuki() as kobuki, owning(kobuki):
        assert main(["doctor", "--port", kobuki.url]) == 1
    assert "Another program has it" in capsys.readouterr().out


@POSIX
@pytest.mark.server
@pytest.mark.parametrize(
    ("after_s", "told"),
    [(0.3, "ok  A watchdog took its power"), (1.4, "ok  The emergency stop"), (9.0, "!!  Nothing")],
)
def test_the_doctor_tries_the_hardware_cut(capsys, monkeypatch, after_s, told):
    monkeypatch.setattr(doctor, "WATCHDOG_S", 1.2)
    monkeypatch.setattr(doctor, "PRESS_S", 1.5)
    with FakeKobuki() as kobuki:
        timer = threading.Timer(after_s, lambda: setattr(kobuki, "is_mute", True))
        timer.start()
        status = main(["doctor", "--cut", "--port", kobuki.url])
        timer.cancel()
        assert not any(speed for _, speed, _ in kobuki.orders)
    said = capsys.readouterr().out
    assert told in said
    assert status == (1 if "!!" in told else 0)
