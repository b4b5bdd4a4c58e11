"""A live stream that is looked at before anybody walks with it."""

import asyncio
import contextlib
import json
import socket
import threading
from functools import partial

import numpy as np
import pytest

from rehab.sources.__main__ import EXIT_DONE, EXIT_UNSURE, EXIT_UNUSABLE, main
from rehab.sources.intake import IntakeSettings, stream_check
from rehab.sources.intake.stream_check import StreamCheck
from rehab.sources.reporting import SourceError
from rehab.sources.synthetic.signals import Sensors
from rehab.sources.synthetic.walker import walk
from tests.support.synthetic_recordings import make_signals

MASS = 75.0
NAMES = ("stamp", "FP1", "FP2", "LMom", "RMom", "LAnk", "RAnk")


@pytest.fixture(scope="module")
def table():
    """Return the columns of a lab that has its own names, signs and degrees."""
    made = make_signals(list(walk(seed=4, strides=40)), MASS, Sensors(rate_hz=100), seed=4)
    left, right = made.left, made.right
    return np.column_stack(
        [made.t_s, -left.force_n, -right.force_n, left.moment_nm, right.moment_nm]
        + [np.degrees(leg.angle_rad) for leg in (left, right)]
    )


def make_check(**settings):
    said: list[str] = []
    now = [0.0]
    check = StreamCheck(IntakeSettings(**settings), said.append, lambda: now[0], 30.0)
    return check, said, now


def feed(check, now, table):
    for at in range(0, len(table), 50):
        rows = table[at : at + 50].tolist()
        check.add_rows(dict(zip(NAMES, row, strict=True)) for row in rows)
        now[0] += 0.5


def test_columns_are_found_once_half_a_minute_has_come(table):
    check, said, now = make_check(mass_kg=MASS)
    feed(check, now, table[:2900])
    assert not check.is_done.is_set()
    feed(check, now, table[2900:])
    assert check.is_done.is_set()
    assert len(said) == 1
    text = "\n".join(check.describe_setup()[0])
    for found in ("left.force=FP1*-1", "right.force=FP2*-1", "left.moment=LMom", "time=stamp"):
        assert found in text
    assert "left.angle=LAnk*0.0174532" in text


def test_a_check_to_which_nothing_comes_says_so_once_with_the_cure():
    check, said, now = make_check()

    async def wait():
        waiting = asyncio.create_task(check.wait_until_done())
        await asyncio.sleep(0)
        for now[0] in (14.0, 16.0, 60.0):
            told = list(said)
            await asyncio.sleep(0.15)
            assert bool(said) is (now[0] > 15), told
        waiting.cancel()

    asyncio.run(wait())
    (text,) = said
    assert "Nothing has arrived for 15 s. Start the sender" in text


def test_a_stream_with_times_beside_it_and_rows_of_their_own(table):
    check, _, now = make_check()
    check.add_rows([{"stamp": 0.1, "elbow": 2.0}])
    for at in range(0, len(table), 50):
        part = table[at : at + 50]
        check.add_table("lab", NAMES[1:], part[:, 0], part[:, 1:])
        now[0] += 0.5
    lines, _ = check.describe_setup()
    assert lines[0].endswith("elbow, stamp.")
    assert any("time=time_s" in line for line in lines)


def test_nothing_and_strides_are_refused_with_the_cure(table):
    check, said, _ = make_check()
    with pytest.raises(SourceError, match="Start the sender"):
        check.describe_setup()
    check.add_rows([{"value": 3.0}])
    assert "Let the sender send raw signals" in said[0]
    with pytest.raises(SourceError, match="Start the sender"):
        check.describe_setup()


@pytest.mark.parametrize("is_walking", [True, False])
def test_a_lab_is_checked_without_a_server(table, monkeypatch, capsys, is_walking):
    monkeypatch.setattr(stream_check, "StreamCheck", partial(StreamCheck, seconds=0.5))
    shown = table if is_walking else np.column_stack([table[:, :1], 0 * table[:, 1:]])

    def serve(listener):
        sender, _ = listener.accept()
        with sender, contextlib.suppress(OSError):
            for row in shown.tolist():
                sender.sendall((json.dumps(dict(zip(NAMES, row, strict=True))) + "\n").encode())
            closing.wait(10)
            sender.sendall(b'{"stamp": 1}\n')

    closing = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        thread = threading.Thread(target=serve, args=(listener,), daemon=True)
        thread.start()
        threading.Timer(1.0, closing.set).start()
        status = main(["rows", "--connect", f"tcp://127.0.0.1:{port}", "--check", "--mass", "75"])
        thread.join(10)
    said = capsys.readouterr()
    if is_walking:
        assert status in (EXIT_DONE, EXIT_UNSURE)
        assert "left.force=FP1*-1" in said.out
    else:
        assert (status, said.out) == (EXIT_UNUSABLE, "")


def test_a_sender_that_stops_is_checked_after_half_a_minute_too(table):
    now_s = 0.0
    check = StreamCheck(IntakeSettings(), lambda _text: None, lambda: now_s)
    check.add_rows([{"time": 0.0, "Fz": 1.0}])
    now_s = 31.0
    asyncio.run(asyncio.wait_for(check.wait_until_done(), 5))
    assert not check.is_done.is_set()
