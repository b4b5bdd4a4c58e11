"""bleak as it behaves where things go wrong: a radio with sensors in its reach."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

MTU_PART = 20  # bytes of a notification where nobody asked for more


class BleakError(Exception):
    """As `bleak.exc.BleakError`."""


class FakeSensor:
    """A sensor in reach: one central at a time, silent until it is subscribed and started."""

    def __init__(self, name: str, notifies: str, writes: str = "", starts_by: bytes = b"") -> None:
        self.name, self.address = name, f"AA:{len(name):02X}:00:00:00:01"
        self.notifies, self.writes, self.starts_by = notifies, writes, starts_by
        self.is_here = True
        self.refuses = 0  # connections that fail first
        self.connections = 0
        self.written: list[bytes] = []
        self.answer: Callable[[bytes], None] | None = None
        self.client: Any = None
        self.take: Callable[[object, bytearray], None] | None = None
        self.has_started = not starts_by

    @property
    def is_read(self) -> bool:
        return self.take is not None and self.has_started

    def send(self, data: bytes, part: int = MTU_PART) -> None:
        """Send bytes in notifications of so many, in one buffer that is used again."""
        if not self.is_read:
            return
        buffer = bytearray()
        for at in range(0, len(data), part):
            buffer[:] = data[at : at + part]
            assert self.take is not None
            self.take(object(), buffer)
        buffer[:] = b"\xee" * len(buffer)

    def leave(self) -> None:
        """Go out of reach: the radio notices by itself."""
        self.is_here, client = False, self.client
        if client is not None:
            client.drop()


class FakeBleak:
    """The module `bleak`, with these sensors."""

    def __init__(self, *sensors: FakeSensor) -> None:
        self.sensors = sensors
        self.exc = SimpleNamespace(BleakError=BleakError)
        self.scans = 0
        radio = self

        class BleakScanner:
            @staticmethod
            async def find_device_by_filter(matches: Any, timeout: float) -> Any:  # noqa: ASYNC109
                if radio.scans:
                    raise BleakError("[org.bluez.Error.InProgress] Operation already in progress")
                radio.scans += 1
                try:
                    await asyncio.sleep(0.002)
                    for one in radio.sensors:
                        if one.is_here and one.client is None:
                            advertised = SimpleNamespace(local_name=one.name, service_uuids=[])
                            device = SimpleNamespace(name=None, address=one.address, sensor=one)
                            if matches(device, advertised):
                                return device
                    return None
                finally:
                    radio.scans -= 1

        class BleakClient:
            def __init__(self, device: Any, disconnected_callback: Any = None) -> None:
                self.sensor: FakeSensor = device.sensor
                self.is_connected = False
                self._lost = disconnected_callback

            async def __aenter__(self) -> Any:
                await asyncio.sleep(0.001)
                if not self.sensor.is_here or self.sensor.client is not None:
                    raise TimeoutError
                if self.sensor.refuses:
                    self.sensor.refuses -= 1
                    raise BleakError("le-connection-abort-by-local")
                self.sensor.client, self.is_connected = self, True
                self.sensor.connections += 1
                return self

            async def __aexit__(self, *_: object) -> None:
                self.drop()

            @property
            def services(self) -> Any:
                there = {self.sensor.notifies, self.sensor.writes}
                return SimpleNamespace(get_characteristic=lambda uuid: uuid in there or None)

            def drop(self) -> None:
                if self.is_connected:
                    self.is_connected = False
                    self.sensor.client = self.sensor.take = None
                    self.sensor.has_started = not self.sensor.starts_by
                    if self._lost is not None:
                        self._lost(self)

            async def start_notify(self, uuid: str, take: Any) -> None:
                if not self.is_connected or uuid != self.sensor.notifies:
                    raise BleakError(f"Characteristic {uuid} was not found!")
                await asyncio.sleep(0)
                self.sensor.take = take

            async def write_gatt_char(self, uuid: str, data: bytes, response: bool) -> None:
                if not self.is_connected or uuid != self.sensor.writes:
                    raise BleakError("Not connected")
                await asyncio.sleep(0)
                self.sensor.written.append(bytes(data))
                if data == self.sensor.starts_by:
                    self.sensor.has_started = True
                elif self.sensor.answer is not None:
                    self.sensor.answer(bytes(data))

        self.BleakScanner, self.BleakClient = BleakScanner, BleakClient
