"""Sensors on feet or shanks by Bluetooth (own firmware, Movella DOT, WitMotion), heart rate.

    python -m rehab.sources ble --sensor left.foot=NAME right.foot=NAME

NAME is what a sensor calls itself, or its address. `pip install 'garry[ble]'` brings bleak.
"""

from __future__ import annotations

import asyncio
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import ModuleType
from typing import Any

from rehab.gait.recordings.column_mapping import SignalColumn
from rehab.sources.ble.adapter import AXES, Adapter, Row
from rehab.sources.ble.heart_rate import HeartRate
from rehab.sources.ble.host_clock import HostClock
from rehab.sources.ble.movella_dot import MovellaDot
from rehab.sources.ble.nordic_uart import NordicUart
from rehab.sources.ble.witmotion import WitMotion
from rehab.sources.intake import Intake, IntakeSettings, add_signal_arguments
from rehab.sources.intake.rows import VALUE
from rehab.sources.intake.settings import Wearable, read_place
from rehab.sources.reporting import Notify, SourceError
from rehab.sources.source import LiveSource

ADAPTERS: tuple[type[Adapter], ...] = (NordicUart, MovellaDot, WitMotion)
SCAN_S = 8.0
RETRY_S = 1.0
SILENT_S = 3.0  # without a sample a connection is dead, whatever the radio says
ASK_FIRST_S, ASK_S = 0.1, 15.0  # between questions for a sensor's time: 8 at first, then
ASKED_FIRST = 8


@dataclass
class _Sensor:
    """One sensor: who wears it where, what it is called, and its clock."""

    wearable: Wearable | None  # None: it measures the heart rate
    name: str
    said: str = ""
    clock: HostClock = field(default_factory=HostClock)


class BleSource(LiveSource):
    """Finds its sensors, reads them, and finds them again after they were away."""

    @classmethod
    def add_arguments(cls, parser: ArgumentParser) -> None:
        """Add the options of this source to a command line."""
        parser.add_argument(
            "--sensor", nargs="+", required=True, metavar="SIDE.PLACE=NAME",
            help="left or right, foot or shank, and the sensor's name or address",
        )  # fmt: skip
        parser.add_argument("--heart-rate", metavar="NAME", help="a heart-rate sensor's name")
        add_signal_arguments(parser)

    def __init__(
        self,
        options: Namespace,
        notify: Notify,
        bleak: ModuleType | Any = None,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        """Read the command line. Raises SourceError, also where bleak is missing."""
        sensors = [_read_sensor(text) for text in options.sensor]
        worn = tuple(one.wearable for one in sensors if one.wearable)
        if len({(one.side, one.place) for one in worn}) < len(worn):
            raise SourceError("--sensor names a place twice. Give each sensor a place of its own.")
        if options.heart_rate:
            sensors.append(_Sensor(None, options.heart_rate))
        if len({one.name for one in sensors}) < len(sensors):
            raise SourceError("--sensor names a sensor twice. Give each place one of its own.")
        self.settings = replace(IntakeSettings.read(options), wearables=worn)
        self._sensors, self._notify, self._monotonic = sensors, notify, monotonic
        self._bleak = bleak or _import_bleak()
        self._scanning = asyncio.Lock()  # BlueZ refuses a second scan
        self._asked: dict[tuple[int, int], float] = {}  # questions for the time: when [s]

    async def read(self, intake: Intake) -> None:
        """Read all sensors for as long as this runs."""
        async with asyncio.TaskGroup() as group:
            for sensor in self._sensors:
                group.create_task(self._keep_reading(sensor, intake))

    async def _keep_reading(self, sensor: _Sensor, intake: Intake) -> None:
        failures = (self._bleak.exc.BleakError, OSError, EOFError, TimeoutError)
        while True:
            try:
                device = await self._find(sensor)
                if device is not None:
                    await self._read_connection(sensor, device, intake)
            except failures as problem:
                self._say(sensor, f"{sensor.name} is gone ({problem or 'no answer'}).")
            await asyncio.sleep(RETRY_S)

    async def _find(self, sensor: _Sensor) -> Any:
        """Return the device of a name or address; None where it is not here now."""
        seen: set[str] = set()

        def matches(device: Any, advertised: Any) -> bool:
            name = advertised.local_name or device.name or ""
            seen.add(name or device.address)
            return sensor.name.casefold() in (name.casefold(), device.address.casefold())

        async with self._scanning:
            device = await self._bleak.BleakScanner.find_device_by_filter(matches, timeout=SCAN_S)
        if device is None:
            others = ", ".join(sorted(seen)[:12]) or "none"
            self._say(
                sensor, f"{sensor.name} is not here. Switch it on, or name one of these: {others}."
            )
        return device

    async def _read_connection(self, sensor: _Sensor, device: Any, intake: Intake) -> None:
        lost, heard = asyncio.Event(), asyncio.Event()

        def take(_characteristic: object, data: bytearray) -> None:
            heard.set()
            self._take(sensor, adapter, bytes(data), intake)

        async with self._bleak.BleakClient(device, lambda _client: lost.set()) as client:
            kinds = ADAPTERS if sensor.wearable else (HeartRate,)
            known = [one for one in kinds if client.services.get_characteristic(one.notifies)]
            if not known:
                self._say(
                    sensor, f"{sensor.name} is no sensor that GARRY knows. Its firmware may be old."
                )
                return
            adapter = known[0]()
            sensor.clock = HostClock()  # it may have restarted
            await client.start_notify(adapter.notifies, take)
            if adapter.start:
                await client.write_gatt_char(*adapter.start, response=True)
            worn = sensor.wearable
            where = f"{worn.side} {worn.place}" if worn else "heart rate"
            self._say(sensor, f"Reading {sensor.name} ({where}). {adapter.warning}".rstrip())
            asking = asyncio.create_task(self._ask_times(client, adapter))
            try:
                await self._wait_for_end(lost, heard)
            finally:
                asking.cancel()
                await asyncio.gather(asking, return_exceptions=True)
        self._say(sensor, f"{sensor.name} is gone. It is read again once it is back.")

    async def _wait_for_end(self, lost: asyncio.Event, heard: asyncio.Event) -> None:
        while not lost.is_set():
            heard.clear()
            try:
                async with asyncio.timeout(SILENT_S):
                    await lost.wait()
            except TimeoutError:
                if not heard.is_set():
                    return

    async def _ask_times(self, client: Any, adapter: Adapter) -> None:
        number = 0
        while (question := adapter.ask_time(number)) is not None:
            self._asked[id(adapter), number] = self._monotonic()
            await client.write_gatt_char(*question, response=False)
            number += 1
            await asyncio.sleep(ASK_FIRST_S if number < ASKED_FIRST else ASK_S)

    def _take(self, sensor: _Sensor, adapter: Adapter, data: bytes, intake: Intake) -> None:
        now_s, damaged = self._monotonic(), adapter.damaged
        rows = adapter.read(data, now_s)
        for _ in range(adapter.damaged - damaged):
            intake.reject_row(
                f"A packet of {sensor.name} was damaged. Use a computer nearer to it."
            )
        for number, sensor_s in adapter.read_times():
            asked_s = self._asked.pop((id(adapter), number), None)
            if asked_s is not None:
                sensor.clock.exchange(asked_s, sensor_s, now_s)
        wearable = sensor.wearable
        if wearable is None:
            intake.add_rows(rows)
            return
        intake.add_rows([_name(row, wearable, sensor.clock, now_s) for row in rows])
        intake.set_clock_error(wearable.side, wearable.place, sensor.clock.error_s(now_s))

    def _say(self, sensor: _Sensor, text: str) -> None:
        if text != sensor.said:
            sensor.said = text
            self._notify(text)


def _name(row: Row, wearable: Wearable, clock: HostClock, now_s: float) -> Row:
    """Return a sensor's sample with the columns of its place, its time on our clock."""
    time_s = row["time_s"]
    assert isinstance(time_s, float)  # noqa: S101 (each adapter's)
    named = {
        f"{wearable.side}_{wearable.place}_{name}" if name in AXES else name: cell
        for name, cell in row.items()
    }
    return named | {"time_s": time_s if VALUE in row else clock.place(time_s, now_s)}


def _read_sensor(text: str) -> _Sensor:
    """Return what a text such as ``left.foot=DOT 3`` says. Raises SourceError."""
    where, _, name = text.partition("=")
    place = read_place(where)
    if place is None or not name:
        raise SourceError(
            f"'{text}' names no sensor. Write SIDE.PLACE=NAME with SIDE left or right, PLACE foot "
            "or shank, and the sensor's name or address: left.foot=GARRY-1"
        )
    side, worn = place
    columns = tuple(SignalColumn(f"{side}_{worn}_{axis}") for axis in AXES)
    return _Sensor(Wearable(side, worn, columns), name)


def _import_bleak() -> ModuleType:
    try:
        import bleak
        import bleak.exc
    except ImportError:
        raise SourceError(
            "Bluetooth needs the package bleak. Install it: pip install 'garry[ble]'"
        ) from None
    return bleak
