"""Labs that send to each source: what a contract test needs of every one of them."""

import asyncio
import json
import queue
from collections.abc import Sequence
from contextlib import asynccontextmanager
from pathlib import Path

from websockets.asyncio.server import serve

from rehab.sources import SOURCES
from rehab.sources.arguments import make_parser
from rehab.sources.ble.nordic_uart import NordicUart
from rehab.sources.intake.sensor_frames import compute_checksum
from rehab.training.steps import Measurement
from tests.sources.fake_bleak import FakeBleak, FakeSensor
from tests.sources.fake_lsl import FakeLsl

SETTINGS = ["--token", "t"]


class Lab:
    """Something that sends strides to a source.

    ``sends`` says whether it does when asked; else the source has all of its strides beforehand.
    """

    name = ""
    sends = True

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.said: list[str] = []
        self.typed: list[str] = []  # instead of its arguments

    def arguments(self) -> list[str]:
        return []

    def make(self, *more: str):
        """Make the source as its command line does."""
        source = SOURCES[self.name]
        options = make_parser(self.name, source).parse_args(
            [*(self.typed or self.arguments()), *more, *SETTINGS]
        )
        return self.build(source, options)

    def build(self, source, options):
        return source(options, self.said.append)

    @asynccontextmanager
    async def open(self):
        """Be there."""
        yield

    async def send(self, source, values: Sequence[float]) -> None:
        """Send a stride for each value."""

    async def garble(self, source) -> None:
        """Send what nobody can read."""


class RecordingLab(Lab):
    name, sends = "recording", False

    def arguments(self):
        path = self.folder / "walk.csv"
        rows = "".join(f"{n},{3 + n / 100},0.7\n" for n in range(1, 31))
        path.write_text(f"time_s,value,stance_s\n{rows}", "utf-8")
        return [str(path)]


class SignalRecordingLab(Lab):
    name, sends = "recording", False

    def arguments(self):
        from rehab.sources.synthetic.walker import walk
        from tests.support.synthetic_recordings import make_signals

        made = make_signals(list(walk(strides=20)))
        left = made.left
        rows = zip(made.t_s, left.force_n, left.moment_nm, left.angle_rad, strict=True)
        lines = "".join(",".join(f"{cell:.6f}" for cell in row) + "\n" for row in rows)
        path = self.folder / "signals.csv"
        path.write_text(f"time_s,left_force_n,left_moment_nm,left_angle_rad\n{lines}", "utf-8")
        return [str(path), "--mass", "75"]


class SyntheticLab(Lab):
    name, sends = "synthetic", False

    def arguments(self):
        return ["--strides", "30"]


class SyntheticSignalsLab(SyntheticLab):
    def arguments(self):
        return ["--strides", "30", "--signals"]


class RowsLab(Lab):
    """Rows by TCP, in the order that one writer keeps."""

    name, kind = "rows", "tcp"

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.clock_s = 100.0
        self.writer: asyncio.StreamWriter | None = None

    def arguments(self):
        return ["--listen", f"{self.kind}://127.0.0.1:0"]

    async def _write(self, source, text: str) -> None:
        while not source.address.port:  # noqa: ASYNC110
            await asyncio.sleep(0.002)
        if self.writer is None:
            _, self.writer = await asyncio.open_connection("127.0.0.1", source.address.port)
            self.writer.write(b"time_s,value,stance_s,side\n")
        self.writer.write(text.encode())
        await self.writer.drain()

    async def send(self, source, values):
        for value in values:
            self.clock_s += 1.1
            await self._write(source, f"{self.clock_s},{value},0.7,left\n")

    async def garble(self, source):
        await self._write(source, "1,2\n,,,\nnever,3,1,left\n5,3,1,middle\n{]\n\x00\x01\n")

    @asynccontextmanager
    async def open(self):
        yield
        if self.writer is not None:
            self.writer.close()


class MatlabLab(Lab):
    """GarryMatlabServer.m as it was: a keyword in, ``a2, goal`` out, then ``end``."""

    name = "matlab"

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.port = 0
        self.keywords: list[str] = []
        self.waiting: asyncio.Queue[str] = asyncio.Queue()

    def arguments(self):
        return ["--connect", f"ws://127.0.0.1:{self.port}"]

    async def _serve(self, socket) -> None:
        self.keywords.append(await socket.recv())
        telling = asyncio.create_task(self._tell(socket))
        await asyncio.wait(
            [telling, asyncio.create_task(socket.wait_closed())],
            return_when=asyncio.FIRST_COMPLETED,
        )
        telling.cancel()

    async def _tell(self, socket) -> None:
        text = ""
        while text != "end":
            text = await self.waiting.get()
            await socket.send(text)

    @asynccontextmanager
    async def open(self):
        async with serve(self._serve, "127.0.0.1", 0) as server:
            self.port = server.sockets[0].getsockname()[1]
            yield

    async def send(self, source, values):
        for value in values:
            self.waiting.put_nowait(f"{value:f}, 3.908000")

    async def garble(self, source):
        for text in ("you connected lets gooo 1", "1,2,3", "", "Inf"):
            self.waiting.put_nowait(text)


class FakePort:
    """A serial port with bytes to read, that can be pulled out."""

    def __init__(self) -> None:
        self.bytes: queue.Queue[bytes | OSError] = queue.Queue()
        self.opened = 0

    in_waiting = 0

    def read(self, _size: int = 1, /) -> bytes:
        try:
            found = self.bytes.get(timeout=0.02)
        except queue.Empty:
            return b""
        if isinstance(found, OSError):
            raise found
        return found

    def close(self) -> None:
        pass


def frame(kind: str, *cells: object) -> bytes:
    """Write a frame as the sketch does."""
    body = ",".join([kind, *map(str, cells)]).encode()
    return b"$%s*%02X\n" % (body, compute_checksum(body))


class SerialLab(Lab):
    name = "serial_sensor"

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.port = FakePort()
        self.clock_us = 2**32 - 3_000_000  # wraps around on the way

    def arguments(self):
        return ["--port", "COM7"]

    def build(self, source, options):
        def open_port(_port, _baud):
            self.port.opened += 1
            self.port.bytes.put(frame("H", "value", "stance_s"))
            return self.port

        return source(options, self.said.append, open_port)

    async def send(self, source, values):
        for value in values:
            self.clock_us = (self.clock_us + 1_100_000) % 2**32
            self.port.bytes.put(frame("D", self.clock_us, value, 0.7))

    async def garble(self, source):
        good = frame("D", self.clock_us, 3.3, 0.7)
        for bad in (good[3:], good[:9] + b"\n", good.replace(b"3.3", b"9.3"), b"\xff\x00\n"):
            self.port.bytes.put(bad)


class LslLab(Lab):
    name = "lsl"

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.lsl = FakeLsl()
        self.outlet = self.lsl.add("strides", ("value", "stance_s"))

    def arguments(self):
        return ["--stream", "strides"]

    def build(self, source, options):
        return source(options, self.said.append, self.lsl)

    async def send(self, source, values):
        for value in values:
            self.outlet.push([value, 0.7], step_s=1.1)

    async def garble(self, source):
        self.outlet.push(["rubbish", 0.7], step_s=0.0)


class BleLab(Lab):
    name = "ble"

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.sensor = FakeSensor("GARRY-1", NordicUart.notifies, NordicUart._writes)
        self.clock_us = 2**32 - 3_000_000

    def arguments(self):
        return ["--sensor", "left.foot=GARRY-1"]

    def build(self, source, options):
        return source(options, self.said.append, FakeBleak(self.sensor))

    async def _wait(self):
        async with asyncio.timeout(5):
            while not self.sensor.is_read:  # noqa: ASYNC110
                await asyncio.sleep(0.002)

    async def send(self, source, values):
        await self._wait()
        self.sensor.send(frame("H", "value", "stance_s"))
        for value in values:
            self.clock_us = (self.clock_us + 1_100_000) % 2**32
            self.sensor.send(frame("D", self.clock_us, value, 0.7))

    async def garble(self, source):
        await self._wait()
        good = frame("D", self.clock_us, 3.3, 0.7)
        for bad in (good[3:], good[:9] + b"\n", good.replace(b"3.3", b"9.3"), b"\xff\x00\n"):
            self.sensor.send(bad)


LABS = (
    *(RecordingLab, SignalRecordingLab, SyntheticLab, SyntheticSignalsLab),
    *(RowsLab, MatlabLab, SerialLab, LslLab, BleLab),
)


def json_line(**cells: object) -> str:
    """Write a row as JSON."""
    return json.dumps(cells) + "\n"


async def until_strides(harness, count):
    """Return the strides that an intake puts out, as soon as there are so many."""
    found: list[Measurement] = []
    async with asyncio.timeout(5):
        while len(found) < count:
            found += harness.strides()
            await asyncio.sleep(0.005)
    return found
