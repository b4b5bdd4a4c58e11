"""Rows by every way that labs have, from one sender at a time."""

import asyncio
import socket
from contextlib import asynccontextmanager

import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import serve

from rehab.sources.intake import Intake, LineReader, parse_address
from rehab.sources.intake.lines import MAX_LINE
from rehab.sources.reporting import SourceError
from tests.sources.intake_harness import IntakeHarness
from tests.sources.labs import RowsLab, json_line, until_strides


class UdpLab(RowsLab):
    kind = "udp"


class WsLab(RowsLab):
    kind = "ws"


@asynccontextmanager
async def reading(lab, *more):
    """Read what a lab sends, without a server behind."""
    harness, source = IntakeHarness(mass_kg=None), lab.make(*more)
    intake = Intake(harness.feed, source.settings, lab.said.append, harness.time)
    task = asyncio.create_task(source.read(intake))
    try:
        async with asyncio.timeout(5):
            while not task.done() and not source.address.port:  # noqa: ASYNC110
                await asyncio.sleep(0.002)
        yield harness, source.address.port, task
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


STRIDES = [json_line(time_s=n * 1.1, value=3.0 + n, symmetry=0.1) for n in range(1, 5)]


async def test_udp_hears_one_sender_and_tells_of_the_other(tmp_path):
    lab = UdpLab(tmp_path)
    async with reading(lab) as (harness, port, _):
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as two,
        ):
            one.sendto("".join(STRIDES[:2]).encode(), ("127.0.0.1", port))
            first = await until_strides(harness, 2)
            two.sendto(STRIDES[3].encode(), ("127.0.0.1", port))
            one.sendto(STRIDES[2].rstrip().encode(), ("127.0.0.1", port))
            rest = await until_strides(harness, 1)

    assert [m.value for m in first + rest] == [4.0, 5.0, 6.0]
    assert first[0].extra == {"symmetry": 0.1}
    assert any("is not heard. Stop one of the two." in text for text in lab.said)


async def test_websocket_turns_a_second_sender_away(tmp_path):
    lab = WsLab(tmp_path)
    async with (
        reading(lab) as (harness, port, _),
        connect(f"ws://127.0.0.1:{port}", proxy=None) as one,
        connect(f"ws://127.0.0.1:{port}", proxy=None) as two,
    ):
        await one.send("\n".join(STRIDES[:3]))
        found = await until_strides(harness, 3)
        assert "Stop it first" in await two.recv()

    assert [m.value for m in found] == [4.0, 5.0, 6.0]


async def test_tcp_turns_a_second_sender_away_and_hears_it_later(tmp_path):
    lab = RowsLab(tmp_path)
    async with reading(lab) as (harness, port, _):
        _, one = await asyncio.open_connection("127.0.0.1", port)
        one.write(STRIDES[0].encode())
        found = await until_strides(harness, 1)
        reader, turned_away = await asyncio.open_connection("127.0.0.1", port)
        assert b"Stop it first" in await reader.read()
        turned_away.close()
        one.close()
        await asyncio.sleep(0.05)
        _, two = await asyncio.open_connection("127.0.0.1", port)
        two.write(STRIDES[1].encode())
        found += await until_strides(harness, 1)
        two.close()

    assert [m.value for m in found] == [4.0, 5.0]


async def test_a_garbled_cell_does_not_hang_up_on_the_lab(tmp_path):
    lab = RowsLab(tmp_path)
    async with reading(lab, "--mass", "75", "--rate", "100") as (_, port, task):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        leg = {"left_force_n": 500.0, "left_moment_nm": 10.0, "left_angle_rad": 0.1}
        lines = [json_line(time_s=n / 100, **leg) for n in range(300)]
        lines[200] = json_line(time_s=2.0, **leg | {"left_moment_nm": "ERR"})
        writer.write("".join(lines).encode())
        async with asyncio.timeout(5):
            while not any("'ERR', which is no number" in text for text in lab.said):  # noqa: ASYNC110
                await asyncio.sleep(0.005)
        assert not reader.at_eof()
        assert not task.done()
        assert not any("sends no more" in text for text in lab.said)
        writer.close()


async def test_a_lab_that_serves_is_dialed_again(tmp_path):
    lab = RowsLab(tmp_path)
    times = 0

    async def tell(ws):
        nonlocal times
        times += 1
        await ws.send(STRIDES[times - 1])

    async with serve(tell, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        lab.typed = ["--connect", f"ws://127.0.0.1:{port}"]
        async with reading(lab) as (harness, _, _):
            found = await until_strides(harness, 2)

    assert [m.value for m in found] == [4.0, 5.0]


async def test_a_port_that_is_taken_is_said_with_the_cure(tmp_path):
    lab = RowsLab(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as other:
        lab.typed = ["--listen", f"tcp://127.0.0.1:{other.getsockname()[1]}"]
        async with reading(lab) as (_, _, task):
            with pytest.raises(SourceError, match="take another port"):
                await task


@pytest.mark.parametrize("text", ["9101", "http://x:1", "tcp://x", "udp://:9", "tcp://x:99999"])
def test_what_is_no_address_is_said_with_the_cure(text):
    with pytest.raises(SourceError, match=r"Write one like tcp://127\.0\.0\.1:9101"):
        parse_address(text)


def test_lines_may_be_cut_anywhere():
    data = b"time_s;value\r\n1.5;3,25\r\n2.5;\r\n3.5;3.5\r\n"
    whole = LineReader().read_bytes(data)
    reader = LineReader()
    rows = [row for byte in data for row in reader.read_bytes(bytes([byte]))[0]]

    assert rows == whole[0]
    assert rows[1] == {"time_s": 2.5, "value": None}


def test_a_line_without_end_is_told_once_and_takes_no_memory():
    reader, wrong = LineReader(), []
    for _ in range(50):
        wrong += reader.read_bytes(b"x" * 20_000)[1]
    assert len(wrong) == 1
    assert len(reader._partial) <= MAX_LINE + 20_000
    assert reader.read_bytes(b'\n{"value": 1}\n')[0] == [{"value": 1.0}]


@pytest.mark.parametrize(
    "line",
    ["1,2", '{"a": [1]}', "{", '{"a": {"b": 1}}', "a,a,b", "[1, 2]", '{"a": 1}}', "1_000"],
)
def test_lines_of_no_use_say_what_to_send(line):
    rows, wrong = LineReader().read_bytes(f"{line}\n".encode())
    assert rows == []
    assert len(wrong) == 1
