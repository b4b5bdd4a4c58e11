"""The process that owns a port: it stops the base whatever becomes of its owner."""

import json
import os
import signal
import sys
import time
from itertools import count
from pathlib import Path
from typing import Any

import psutil
import pytest

from robot.port.owner import LEAVE_S, PortOwner
from tests.support.fake_kobuki import FORWARD_200, STOP_FRAME, FakeKobuki
from tests.support.port_process import Owner, owning

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pty")
ROOT = Path(__file__).parents[3]


@pytest.fixture(params=["pty", "socket"])
def kobuki(request):
    with FakeKobuki(request.param) as kobuki:
        yield kobuki


def zeros_at_the_end(kobuki):
    speeds = [speed for _, speed, _ in kobuki.orders]
    return len(speeds) - max((n + 1 for n, speed in enumerate(speeds) if speed), default=0)


@pytest.mark.realtime
def test_it_begins_with_stops_and_pumps_at_50_hz(kobuki):
    with owning(kobuki) as owner:
        assert [speed for _, speed, _ in kobuki.orders[:3]] == [0, 0, 0]
        owner.drive(0.5)
        moving = [at_s for at_s, speed, _ in kobuki.orders if speed == 200]
        assert 20 <= len(moving) <= 40
        assert kobuki.bad == 0


@pytest.mark.essential
@pytest.mark.realtime
def test_stale_orders_stop_it(kobuki):
    with owning(kobuki) as owner:
        owner.drive(0.3)
        since_s = time.monotonic()
        time.sleep(0.5)
        assert 0.15 < kobuki.moved_after(since_s) <= 0.35


@pytest.mark.essential
@pytest.mark.realtime
@pytest.mark.parametrize("how", ["pipe closes", "SIGTERM", "SIGHUP"])
def test_its_end_stops_it_three_times(kobuki, how):
    with owning(kobuki) as owner:
        owner.drive(0.3)
        since_s = time.monotonic()
        if how == "pipe closes":
            owner.process.stdin.close()
            owner.process.stdin = None
        else:
            owner.process.send_signal(getattr(signal, how))
        assert owner.process.wait(5) == 0
        time.sleep(0.05)
        assert kobuki.moved_after(since_s) <= 0.1
        assert zeros_at_the_end(kobuki) >= 3


@pytest.mark.realtime
def test_ctrl_c_is_for_who_orders(kobuki):
    with owning(kobuki) as owner:
        owner.process.send_signal(signal.SIGINT)
        owner.drive(0.2)
        assert kobuki.is_moving


@pytest.mark.realtime
def test_nobody_reads_what_it_hears_and_it_goes_on(kobuki):
    with owning(kobuki) as owner:
        kobuki.noise = bytes(range(256)) * 600  # more than a pipe holds
        owner.drive(1.0)
        assert kobuki.is_moving
        late = [b[0] - a[0] for a, b in zip(kobuki.orders, kobuki.orders[1:], strict=False)]
        assert max(late) < 0.2


@pytest.mark.realtime
def test_a_base_that_takes_nothing_is_lost_and_found():
    with FakeKobuki() as kobuki, owning(kobuki) as owner:
        kobuki.is_flooded = True
        owner.drive(0.2)
        owner.order(STOP_FRAME, once="00")
        kobuki.is_flooded = False
        kobuki.until(lambda: not kobuki.is_moving)


@pytest.mark.realtime
def test_it_outlives_who_orders_until_a_lost_base_is_stopped(tmp_path):
    port = tmp_path / "kobuki"
    with FakeKobuki() as kobuki:
        port.symlink_to(kobuki.url)
        owner = Owner(str(port))
        while not owner.hear()["bytes"]:
            pass
        owner.drive(0.3)
        port.unlink()
        kobuki.unplug()
        while not owner.hear()["owes_stop"]:
            pass
        owner.process.stdin.close()
        owner.process.stdout.close()
        time.sleep(0.5)
        with FakeKobuki() as again:
            back_s = time.monotonic()
            port.symlink_to(again.url)
            again.until(lambda: len(again.orders) >= 3)
            assert time.monotonic() - back_s < 0.3
            assert owner.process.wait(5) == 0
            assert not any(speed for _, speed, _ in again.orders)
    assert owner.process.stderr.read() == b""
    owner.process.stderr.close()


@pytest.mark.realtime
def test_any_line_is_counted_and_moves_nothing(kobuki):
    with owning(kobuki) as owner:
        for junk in (b"\n", b"junk\n", b"\xff\x00\n", b"[1]\n", b"9" * 100_000 + b"\n", b"{}\n"):
            owner.process.stdin.write(junk)
        owner.process.stdin.flush()
        while owner.hear()["counters"]["bad"] < 6:
            pass
        assert not any(speed for _, speed, _ in kobuki.orders)
        owner.drive(0.2)
        assert kobuki.is_moving


@pytest.mark.realtime
def test_two_programs_on_one_port():
    with FakeKobuki() as kobuki, owning(kobuki) as first:
        second = Owner(kobuki.url)
        while "lock" not in second.hear()["problem"]:
            pass
        second.drive(0.3)
        assert not any(speed for _, speed, _ in kobuki.orders)
        first.drive(0.2)
        assert kobuki.is_moving
        second.process.kill()
        second.end()


# --- without a process: what a port may do --------------------------------------------------------


class Port:
    """A port that fails when it is told to."""

    def __init__(self):
        self.sent, self.problem, self.is_open = [], None, True

    def read(self, size=1):
        if self.problem is not None:
            raise self.problem
        return b""

    def write(self, data):
        self.sent.append(data)
        return len(data)

    def close(self):
        self.is_open = False


class Bench:
    """A port owner on a clock of its own: every look at it takes a millisecond."""

    def __init__(self, *, refuses=False):
        self.now_s, self.end_s, self.each = 10.0, 10.0, lambda: None
        self.ports, self.tries, self.refuses = [], [], refuses
        self.told: list[Any] = []
        self.owner = PortOwner(
            self.open, STOP_FRAME, self.told.append, monotonic=self.monotonic, sleep=self.sleep
        )

    def open(self):
        self.tries.append(self.now_s)
        if self.refuses:
            raise OSError("no such port")
        self.ports.append(Port())
        return self.ports[-1]

    def sleep(self, span_s):
        self.now_s += span_s

    def monotonic(self):
        self.now_s += 0.001
        self.each()
        if self.now_s > self.end_s:
            self.owner.end()
        return self.now_s

    def run(self, for_s, each=lambda: None):
        self.end_s, self.each = self.now_s + for_s, each
        self.owner.run()


PROBLEMS = [OSError(5, "unplugged"), TypeError("closed meanwhile"), ValueError("?"), SystemError()]


@pytest.mark.parametrize("problem", PROBLEMS, ids=repr)
def test_whatever_a_driver_raises_the_port_is_opened_anew_and_stopped(problem):
    bench = Bench()

    def unplug():
        if len(bench.ports) == 1 and bench.now_s > 10.5:
            bench.ports[0].problem = problem

    bench.run(2.0, unplug)
    first, second = bench.ports
    assert not first.is_open
    assert second.sent[:3] == [STOP_FRAME] * 3
    assert any(told["problem"] for told in bench.told)
    assert bench.told[-1]["problem"] == ""
    assert bench.told[-1]["opened"] == 2


def test_a_lost_port_is_tried_again_twenty_times_a_second_for_as_long_as_it_takes():
    bench = Bench(refuses=True)
    bench.run(20.0)
    pauses = [after - before for before, after in zip(bench.tries, bench.tries[1:], strict=False)]
    assert max(pauses) < 0.08
    assert bench.told[-1]["problem"] == "no such port"


def order(number, frame, at_s):
    return json.dumps({"number": number, "sent_s": at_s, "frame": frame.hex()}).encode()


@pytest.mark.parametrize("back_s", [0.3, 30.0])
def test_a_base_whose_port_was_lost_while_it_moved_is_stopped_after_the_end(back_s):
    bench = Bench()
    numbers = count(1)

    def each():
        if bench.now_s < 10.5:
            frame = FORWARD_200 if bench.ports and len(bench.ports[0].sent) > 3 else STOP_FRAME
            bench.owner.fresh_order.store(order(next(numbers), frame, bench.now_s), bench.now_s)
        elif bench.now_s < 11.0 + back_s:
            bench.ports[0].problem, bench.refuses = OSError(5, "unplugged"), True
        else:
            bench.refuses = False

    bench.run(1.0, each)  # its end comes while the port is away
    first, second = bench.ports
    assert FORWARD_200 in first.sent
    assert set(second.sent) == {STOP_FRAME}
    assert not second.is_open
    assert bench.now_s - (11.0 + back_s) < 0.1
    assert any(told["owes_stop"] for told in bench.told)


def test_one_that_stood_is_left_at_once():
    bench = Bench()

    def each():
        if bench.now_s > 10.5:
            bench.ports[0].problem, bench.refuses = OSError(5, "unplugged"), True

    bench.run(1.0, each)
    assert bench.now_s < 11.1
    assert not any(told["owes_stop"] for told in bench.told)


def test_a_port_that_never_comes_back_is_given_up():
    bench = Bench()
    bench.owner._unsure = 1
    bench.refuses = True
    bench.run(1.0)
    assert bench.now_s == pytest.approx(10.0 + 1.0 + LEAVE_S, abs=0.2)


def test_an_exception_of_its_own_stops_the_base():
    bench = Bench()

    class Failure(BaseException):
        pass

    def fail():
        if bench.now_s > 10.3:
            raise Failure

    with pytest.raises(Failure):
        bench.run(1.0, fail)
    assert bench.ports[0].sent[-3:] == [STOP_FRAME] * 3
    assert not bench.ports[0].is_open


@pytest.mark.essential
@pytest.mark.realtime
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no guard")
def test_killed_together_with_its_parent_its_guard_stops_the_base(kobuki):
    with owning(kobuki) as owner:
        owner.drive(0.3)
        assert kobuki.is_moving
        since_s = time.monotonic()
        owner.process.kill()  # nobody else supervises it here
        kobuki.until(lambda: not kobuki.is_moving)
        assert kobuki.moved_after(since_s) <= 0.5
        kobuki.until(lambda: zeros_at_the_end(kobuki) == 3)


@pytest.mark.realtime
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no guard")
def test_its_guard_leaves_with_it(kobuki):
    with owning(kobuki) as owner:
        (guard,) = psutil.Process(owner.process.pid).children()
        owner.drive(0.1)
        owner.process.stdin.close()
        owner.process.stdin = None
        owner.process.wait(5)
        orders = len(kobuki.orders)
        guard.wait(2)
        time.sleep(0.1)
        assert len(kobuki.orders) == orders
