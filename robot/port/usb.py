"""Finds a Kobuki's serial port, and diagnoses it."""

from __future__ import annotations

import getpass
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# A Kobuki's USB chip; the serial number tells it from any other FTDI cable
# (docs/reference/kobuki.md#serial-link).
VENDOR, PRODUCT, SERIAL = 0x0403, 0x6001, "kobuki"
DEFAULT_PORT = "/dev/kobuki"  # made by the udev rule
LATENCY_MS = 1  # the chip's timer; the factory setting is 16 ms

UDEV_RULE = (
    'SUBSYSTEM=="tty", ATTRS{idVendor}=="0403", ATTRS{idProduct}=="6001", '
    'ATTRS{serial}=="kobuki*", ATTR{device/latency_timer}="1", MODE="0660", GROUP="dialout", '
    'SYMLINK+="kobuki"'
)
UDEV_FILE = "/etc/udev/rules.d/60-kobuki.rules"


@dataclass(frozen=True, slots=True)
class Usb:
    """A USB serial port, as the computer lists it."""

    device: str
    vendor: int | None
    product: int | None
    serial: str

    @property
    def is_kobuki(self) -> bool:
        """Whether it is a Kobuki's."""
        return (self.vendor, self.product) == (VENDOR, PRODUCT) and self.serial.startswith(SERIAL)


def list_ports() -> list[Usb]:
    """Return the computer's serial ports."""
    from serial.tools.list_ports import comports

    return [Usb(port.device, port.vid, port.pid, port.serial_number or "") for port in comports()]


def find_port() -> str:
    """Return the port in GARRY_ROBOT_PORT, else a Kobuki's, else the udev rule's."""
    if port := os.environ.get("GARRY_ROBOT_PORT"):
        return port
    return next((usb.device for usb in list_ports() if usb.is_kobuki), DEFAULT_PORT)


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Result of one check; ``cure`` is empty where nothing is wrong."""

    what: str
    cure: str = ""


def check_port(
    port: str,
    usbs: list[Usb],
    *,
    system: str = sys.platform,
    drivers: Path = Path("/sys/bus/usb-serial"),
) -> Iterator[Diagnosis]:
    """Yield the result of each check of a port, without opening it.

    Parameters
    ----------
    port
        As it would be opened; of socket://… nothing is checked.
    usbs
        The result of ``list_ports``.
    system, drivers
        The operating system, and where Linux lists its USB serial drivers.
    """
    kobukis = [usb.device for usb in usbs if usb.is_kobuki]
    if "://" in port:
        yield Diagnosis(f"{port} is reached over the network.")
        return
    if kobukis:
        yield Diagnosis(f"A Kobuki is plugged in at {', '.join(kobukis)}.")
    else:
        yield Diagnosis(
            "No Kobuki is plugged in by USB.",
            "Switch it on (the switch at its side), and plug its USB cable in. A twin's port and a "
            "cable at the 3.3 V serial pins are not listed; name them with --port.",
        )
    if system == "win32":
        return
    if not Path(port).exists():
        yield Diagnosis(f"{port} does not exist.", _cure_missing(kobukis, system, drivers))
        return
    if not os.access(port, os.R_OK | os.W_OK):
        yield Diagnosis(
            f"{getpass.getuser()} may not use {port}.",
            f"sudo usermod -aG dialout {getpass.getuser()}, then sign out and in again; or install "
            f"the udev rule (/help/robot/).",
        )
    else:
        yield Diagnosis(f"{port} may be read and written.")
    latency = drivers / "devices" / Path(port).resolve().name / "latency_timer"
    if latency.exists():
        wait_ms = int(latency.read_text())
        yield Diagnosis(
            f"The USB chip gathers bytes for {wait_ms} ms.",
            ""
            if wait_ms <= LATENCY_MS
            else f"echo {LATENCY_MS} | sudo tee {latency}, or install the udev rule for good.",
        )


def _cure_missing(kobukis: list[str], system: str, drivers: Path) -> str:
    if kobukis:
        return (
            f"Use --port {kobukis[0]}, or have {DEFAULT_PORT} made: write this line to "
            f"{UDEV_FILE}, run `sudo udevadm control --reload && sudo udevadm trigger`, and plug "
            f"it in again:\n    {UDEV_RULE}"
        )
    if system.startswith("linux") and not (drivers / "drivers" / "ftdi_sio").exists():
        return (
            "Linux has not loaded the driver of its USB chip: sudo modprobe ftdi_sio. If that "
            "fails, this kernel comes without it (some small ones do); install the full kernel."
        )
    return "Plug the base in, and switch it on."
