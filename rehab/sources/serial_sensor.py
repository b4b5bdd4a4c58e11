"""A sensor on a serial port, such as an Arduino (docs/garry_sensor/garry_sensor.ino).

Two kinds of frames, each a line of ASCII with the exclusive or of all bytes between ``$`` and
``*`` as two hexadecimal digits::

    $H,left_force_n,left_moment_nm,left_angle_rad*7A      names, at the start and every second
    $D,1234567890,412.5,33.1,0.12*11                      microseconds, then a cell for each name

Microseconds may wrap around at 2³² as ``micros()`` does. An empty cell is a channel without a
sample now. With a name ``value`` each frame is a stride.
"""

from __future__ import annotations

import asyncio
import threading
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping
from typing import Protocol

from rehab.sources.intake import Cell, Intake, IntakeSettings, add_signal_arguments
from rehab.sources.intake.sensor_frames import SensorFrameReader
from rehab.sources.reporting import Notify, SourceError
from rehab.sources.source import LiveSource

BAUD = 921_600
RETRY_S = 1.0
READ_S = 0.05


class Port(Protocol):
    """The part of a pyserial port that is used here."""

    @property
    def in_waiting(self) -> int: ...

    def read(self, size: int = 1, /) -> bytes: ...

    def close(self) -> None: ...


class SerialSensorSource(LiveSource):
    """Reads a serial port in a thread of its own, and reopens it after it was unplugged."""

    @classmethod
    def add_arguments(cls, parser: ArgumentParser) -> None:
        """Add the options of this source to a command line."""
        parser.add_argument("--port", help="such as COM3 or /dev/ttyACM0 (default: the only one)")
        parser.add_argument("--baud", type=int, default=BAUD, help="default: %(default)s")
        add_signal_arguments(parser)

    def __init__(
        self,
        options: Namespace,
        notify: Notify,
        open_port: Callable[[str, int], Port] | None = None,
    ) -> None:
        """Read the command line. Raises SourceError where no port can be chosen."""
        self.settings = IntakeSettings.read(options)
        self.port: str = options.port or find_port()
        self._baud: int = options.baud
        self._notify = notify
        self._open_port = open_port or open_serial

    async def read(self, intake: Intake) -> None:
        """Read frames for as long as this runs."""
        loop = asyncio.get_running_loop()
        stopped = threading.Event()

        def add_rows(rows: list[Mapping[str, Cell]], damaged: int) -> None:
            for _ in range(damaged):
                intake.reject_row(
                    f"A frame of {self.port} was damaged. Use a shorter cable, another USB port or "
                    "the sketch's baud rate (--baud)."
                )
            intake.add_rows(rows)

        def call_in_loop(function: Callable[..., object], *arguments: object) -> None:
            if not stopped.is_set():
                loop.call_soon_threadsafe(function, *arguments)

        reading = threading.Thread(
            target=self._read_port,
            args=(call_in_loop, add_rows, stopped),
            name="serial",
            daemon=True,
        )
        reading.start()
        try:
            await asyncio.Event().wait()
        finally:
            stopped.set()
            await asyncio.to_thread(reading.join, 2.0)

    def _read_port(
        self,
        call_in_loop: Callable[..., None],
        add_rows: Callable[[list[Mapping[str, Cell]], int], None],
        stopped: threading.Event,
    ) -> None:
        last_problem = ""
        while not stopped.is_set():
            try:
                port = self._open_port(self.port, self._baud)
            except (OSError, ValueError) as problem:  # SerialException is an OSError
                text = f"{self.port} cannot be opened ({problem})"
                if text != last_problem:
                    call_in_loop(
                        self._notify, f"{text}. Plug the sensor in, or close what uses it."
                    )
                last_problem = text
                stopped.wait(RETRY_S)
                continue
            last_problem = ""
            call_in_loop(self._notify, f"Reading {self.port}.")
            frames = SensorFrameReader()
            try:
                while not stopped.is_set():
                    data = port.read(max(1, port.in_waiting))
                    before = frames.damaged
                    rows = frames.read(data) if data else []
                    if rows or frames.damaged > before:
                        call_in_loop(add_rows, rows, frames.damaged - before)
            except OSError as problem:
                call_in_loop(
                    self._notify,
                    f"The sensor at {self.port} is gone ({problem}). Plug it in again.",
                )
                stopped.wait(RETRY_S)
            finally:
                port.close()


def open_serial(port: str, baud: int) -> Port:
    """Open a port. Raises OSError or ValueError."""
    import serial

    opened: Port = serial.serial_for_url(port, baudrate=baud, timeout=READ_S)
    return opened


def find_port() -> str:
    """Return the only serial port there is. Raises SourceError."""
    from serial.tools.list_ports import comports

    ports = [found for found in comports() if found.vid is not None]
    if len(ports) == 1:
        return str(ports[0].device)
    there = "; ".join(f"{found.device} ({found.description})" for found in ports)
    raise SourceError(
        f"Several serial ports are here: {there}. Choose one with --port."
        if ports
        else "No sensor is plugged in by USB. Plug it in, or name its port with --port."
    )
