"""A node like the original's, in the middle of a gesture, on real ROS 1: every stop reaches it.

The master, the node, the gate and the base's driver are nodes of rospy; of the rosbridge between
GARRY and ROS, which Debian does not package, only the frames are played. ``GARRY_ORIGINAL_NODE``
may name the original's own gesture_generation.py, to be tried in place of ours.
"""

import asyncio
import os
import signal
import subprocess
import sys
import time
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.support.fake_robot_server import TOKEN, FakeGarry, serve_garry
from tests.support.fake_ros import WATCHDOG, FakeBase, FakeRosbridge, ServedRos, Ticking
from tests.support.real_ros import PYTHON, RosMaster, why_missing

pytestmark = [pytest.mark.ros, pytest.mark.realtime, pytest.mark.server]
ROOT = Path(__file__).parents[3]
NODE = os.environ.get("GARRY_ORIGINAL_NODE", str(ROOT / "tests" / "support" / "original_node.py"))
DRIVEN = "/mobile_base/commands/velocity"
LIMIT_S = 0.75
KOBUKI_S = 0.6  # kobuki_node's own timeout


class Ros(NamedTuple):
    """A master, a base that is a node of it, and where a rosbridge is."""

    master: RosMaster
    robot: FakeBase
    url: str


@pytest.fixture
def ros():
    if reason := why_missing():
        pytest.skip(reason)
    with ExitStack() as stack:
        master = stack.enter_context(RosMaster())
        robot = FakeBase(master.node("base"), time.monotonic, DRIVEN, timeout_s=KOBUKI_S)
        stack.enter_context(Ticking(robot))
        served = ServedRos(FakeRosbridge(master.node("rosbridge"), has_rosapi=False))
        stack.enter_context(served)
        yield Ros(master, robot, served.url)


@asynccontextmanager
async def gesturing(ros, *, gate):
    """Have the node in the middle of a gesture, and yield the server and the worker."""
    garry = FakeGarry()
    garry.welcome |= {"valence": "positive", "watched": True}
    master = ros.master
    with ExitStack() as stack:

        def start(*words):
            process = subprocess.Popen([PYTHON, *words], env=master.env, cwd=ROOT)
            stack.callback(process.wait)
            stack.callback(process.kill)

        start(NODE, *[f"{DRIVEN}:=/garry/gated_cmd_vel"] * gate)
        if gate:
            start(str(WATCHDOG), DRIVEN, "--gate", "--ros", "1")
        async with AsyncExitStack() as astack:
            await astack.enter_async_context(serve_garry(garry))
            worker = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", "robot", "--base", "null", "--black-box", "off"),
                *("--server", garry.url.replace("ws:", "http:").removesuffix("/ws/robot/")),
                *("--original-topics", "feedback_type", "good_step", "--ros-url", ros.url),
                cwd=ROOT,
                env=os.environ | {"GARRY_ROBOT_TOKEN": TOKEN},
            )
            try:
                await garry.until_hello(1)
                time_s, until_s = 0, time.monotonic() + 60
                while not ros.robot.is_moving:  # nodes take seconds to start and to meet
                    assert time.monotonic() < until_s, "no gesture begins"
                    await garry.walk(time_s)
                    time_s += 1
                    await asyncio.sleep(0.1)
                yield garry, worker
            finally:
                for name in (signal.SIGCONT, signal.SIGKILL):
                    if worker.returncode is None:
                        worker.send_signal(name)
                await worker.wait()


async def measure(ros, since_s):
    """Return when it first stood [s], and the way and turn that it made after that [m, rad]."""
    robot = ros.robot
    while robot.is_moving:
        assert time.monotonic() - since_s < 10
        await asyncio.sleep(0.005)
    took_s = time.monotonic() - since_s
    way_m = turned_rad = 0.0
    until_s = time.monotonic() + 7.0  # its whole gesture
    before = time.monotonic()
    while before < until_s:
        await asyncio.sleep(0.005)
        now_s = time.monotonic()
        if robot.is_moving:
            way_m += abs(robot.v_m_s) * (now_s - before)
            turned_rad += abs(robot.w_rad_s) * (now_s - before)
        before = now_s
    return took_s, way_m, turned_rad


@pytest.mark.parametrize("gate", [False, True], ids=["alone", "gate"])
async def test_stop_reaches_its_wheels(ros, gate):
    async with gesturing(ros, gate=gate) as (garry, _):
        since_s = time.monotonic()
        await garry.tell(type="stop")
        took_s, way_m, turned_rad = await measure(ros, since_s)
    print(f"stop, gate {gate}: {took_s:.3f} s, then {way_m:.4f} m, {turned_rad:.3f} rad")
    assert took_s <= LIMIT_S
    assert way_m <= 0.02
    assert turned_rad <= 0.17


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "hung"])
async def test_a_worker_that_is_gone_closes_the_gate(ros, how):
    async with gesturing(ros, gate=True) as (_, worker):
        since_s = time.monotonic()
        worker.send_signal(how)
        took_s, way_m, turned_rad = await measure(ros, since_s)
    print(f"{how.name}: {took_s:.3f} s, then {way_m:.4f} m, {turned_rad:.3f} rad")
    assert took_s <= LIMIT_S
    assert way_m == turned_rad == 0.0
