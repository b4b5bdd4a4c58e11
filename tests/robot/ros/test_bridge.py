"""The base that ROS drives and the original's topics, over a real websocket to a fake rosbridge."""

import asyncio
import json
import os
import socket
import sys
import threading
import time
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from robot.bases import BaseLost
from robot.bases.rosbridge.orders import IN_FLIGHT
from robot.behavior.safety import BASE_SILENT_S
from robot.motion.gestures import GESTURES
from robot.motion.twist import STILL, Twist
from robot.original_connection import OriginalTopics
from robot.play_gesture import main, play_gesture
from robot.ros.original_nodes import OriginalTopicClient
from robot.ros.rosbridge_connection import TIMING, Bridge
from tests.support.driven_ros import (
    come_back,
    lose_while_moving,
    open_base,
    wired_base,
)
from tests.support.fake_robot_server import CUE, TOKEN, FakeGarry, serve_garry
from tests.support.fake_ros import (
    FakeBase,
    FakeRosbridge,
    ServedRos,
    Ticking,
    drive,
    release,
    wait_until,
)

PLAIN_WORDS = ["--ros-robot", "plain", "--own-timeout-s", "0.6"]
ROOT = Path(__file__).parents[3]


@pytest.fixture
def ros():
    """Return a served bridge, with a base behind it."""
    bridge = FakeRosbridge()
    robot = FakeBase(bridge.graph, time.monotonic)
    with ServedRos(bridge) as served, Ticking(robot):
        served.robot = robot
        yield served


@pytest.mark.realtime
def test_it_drives_stops_and_takes_its_leave(ros):
    with open_base(ros.url) as base:
        assert base.problem == ""
        assert base.read().sensors.silent_s < BASE_SILENT_S
        release(base)
        drive(base, Twist(0.1, 0.2), lambda: base.read().pose.x_m > 0.02)
        base.stop()
        since_s = time.monotonic()
        wait_until(lambda: not ros.robot.is_moving)
        assert time.monotonic() - since_s < 0.25  # a few milliseconds; the machine may be busy
        release(base)
        drive(base, Twist(0.1, 0), lambda: ros.robot.is_moving)
    wait_until(lambda: ros.bridge.said[-1]["op"] == "unadvertise")
    assert ros.robot.orders[-1][1:] == (0.0, 0.0)
    assert not ros.bridge.log
    ops = [frame["op"] for frame in ros.bridge.said]
    assert ops[:3] == ["advertise", "subscribe", "subscribe"]
    assert ops[-3:] == ["unsubscribe", "unsubscribe", "unadvertise"]
    assert base.counters["bridge_openings"] == 1


@pytest.mark.realtime
def test_a_gesture_from_the_command_line(ros, capsys):
    words = ["nod", "--base", "rosbridge", *PLAIN_WORDS, "--ros-url", ros.url, "--json"]
    assert main(words) == 0
    played = json.loads(capsys.readouterr().out)
    assert played["outcome"] == "done"
    assert played["abilities"]["closed_loop"]
    assert not played["abilities"]["bumpers"]
    assert abs(ros.robot.x_m - 3.0) < 0.02
    wait_until(lambda: not ros.robot.is_moving, 0.4)  # not by its own timeout


@pytest.mark.realtime
def test_an_open_loop_says_so_to_people(ros, capsys):
    words = ["nod", "--base", "rosbridge", *PLAIN_WORDS, "--odom-topic", "none"]
    assert main([*words, "--ros-url", ros.url]) == 0
    assert "open loop" in capsys.readouterr().out


def test_nobody_there_is_told_with_the_cure(capsys, monkeypatch):
    monkeypatch.setattr("robot.bases.rosbridge.base.GREETING_S", 0.1)
    with socket.create_server(("127.0.0.1", 0)) as nobody:
        url = f"ws://127.0.0.1:{nobody.getsockname()[1]}"
    assert main(["nod", "--base", "rosbridge", "--ros-url", url]) == 1
    said = capsys.readouterr()
    assert "base_silent" in said.out
    assert f"No rosbridge answers at {url}" in said.err


@pytest.mark.realtime
def test_a_bridge_that_comes_back_hears_a_stop_first_and_nothing_old(ros):
    with wired_base(ros) as (wire, base):
        lose_while_moving(ros, wire, base)
        assert base.read().sensors.silent_s > BASE_SILENT_S
        for _ in range(10):
            base.drive(Twist(0.2, 0))
        assert come_back(ros, wire, base) == {(0.0, 0.0)}
        assert base.counters["bridge_openings"] == 2
        assert base.counters["refused"] > 0


@pytest.mark.realtime
def test_a_black_hole_is_told_and_stops_it(ros):
    with wired_base(ros) as (wire, base):
        threading.Timer(0.6, wire.freeze).start()
        played = play_gesture(GESTURES["celebrate"], base, time.monotonic, time.sleep)
        assert played["outcome"] == "base_silent"
        assert played["took_s"] < 0.6 + BASE_SILENT_S + 0.3  # the machine may be busy
        wait_until(lambda: not ros.robot.is_moving)  # by its own timeout
        before = len(ros.robot.orders)
        wait_until(lambda: base.problem != "")
        wire.thaw()
        drive(base, STILL, lambda: base.read().sensors.silent_s < BASE_SILENT_S)
        # The orders that were on their way came late, and standing still right behind them.
        late = ros.robot.orders[before:]
        assert [any(order[1:]) for order in late].count(True) <= IN_FLIGHT
        assert not any(any(order[1:]) for order in late[IN_FLIGHT:])
        assert late[1][0] - late[0][0] < 0.05


@pytest.mark.realtime
@pytest.mark.parametrize(
    "text",
    [
        *("", "x", "NaN", "7", "[]", "{}", '{"op":"publish","topic":"/odom","msg":{}}'),
        '{"op":"publish","topic":"/cmd_vel","msg":{"linear":{"x":NaN},"angular":{"z":1}}}',
        '{"op":"service_response","id":"/cmd_vel","values":"no","result":false}',
        "[" * 5000,
        "x" * 100_000,
    ],
    ids=range(11),
)
def test_garbage_from_a_bridge_moves_nothing_and_is_outlived(ros, text):
    with open_base(ros.url) as base:
        ros.say(text)
        openings = 2 if len(text) > 64 * 1024 else 1  # too long a frame ends a connection

        def is_back():
            return (
                base.counters["bridge_openings"] == openings
                and base.read().sensors.silent_s < BASE_SILENT_S
            )

        drive(base, STILL, is_back)
        release(base)
        drive(base, Twist(0.1, 0), lambda: ros.robot.is_moving)
    wait_until(lambda: not ros.robot.is_moving, 0.4)  # not by its own timeout


def test_pauses_between_attempts_grow_to_five_seconds_and_no_further():
    pauses, enough = [], threading.Event()

    async def sleep(span_s):
        pauses.append(span_s)
        if len(pauses) >= 10:
            enough.set()

    with socket.create_server(("127.0.0.1", 0)) as nobody:
        url = f"ws://127.0.0.1:{nobody.getsockname()[1]}"
    bridge = Bridge(OriginalTopicClient(["data"]), sleep=sleep, jitter=lambda: 0.0)
    bridge.open(url)
    assert enough.wait(10)
    bridge.close()
    assert bridge.is_dead
    assert pauses[:6] == [0.05, 0.1, 0.2, 0.4, 0.8, 1.0]
    assert max(pauses) == TIMING.retry_longest_s


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_thread_that_ended_is_a_base_that_is_lost(ros, monkeypatch):
    with open_base(ros.url) as base:
        monkeypatch.setattr(base._client, "due", lambda now_s: 1 / 0)
        wait_until(lambda: base._bridge.is_dead)
        with pytest.raises(BaseLost, match="see its messages above"):
            base.drive(STILL)
        base.stop()  # never raises


@pytest.mark.essential
@pytest.mark.realtime
def test_it_stands_still_by_itself_when_whoever_orders_hangs(ros):
    with open_base(ros.url) as base:
        release(base)
        drive(base, Twist(0.1, 0), lambda: ros.robot.is_moving)
        time.sleep(0.25)
        wait_until(lambda: not ros.robot.is_moving, 0.2)
        assert base.counters["lapsed"] == 1


# --- the original's topics, at the same bridge --------------------------------------------------


def test_what_the_original_s_nodes_hear(ros):
    graph, heard = ros.bridge.graph, []
    for topic, kind in (
        ("/garry/feedback_type", "std_msgs/String"),
        ("/garry/good_step", "std_msgs/Bool"),
        ("/garry/data", "garry_ros/UserData"),
    ):
        graph.subscribe(topic, kind, lambda message, topic=topic: heard.append((topic, message)))
    with OriginalTopics(ros.url) as originals:
        wait_until(lambda: originals.problem == "")
        originals.allow(True)
        originals.handle_message({"type": "welcome", "session": 7, "valence": "binary"})
        wait_until(lambda: ("/garry/feedback_type", {"data": "Binary"}) in heard)
        wait_until(lambda: ("/garry/good_step", {"data": False}) in heard)
        heard.clear()
        originals.allow(True)
        originals.publish_decision(True, 5.0)
        originals.handle_message({"type": "step", "shown": 0.93, "goal": 1.1})
        wait_until(lambda: len(heard) >= 2)
    assert heard[:2] == [
        ("/garry/good_step", {"data": True}),
        ("/garry/data", {"a2": 0.93, "goal": 1.1}),
    ]
    wait_until(lambda: heard[2:] == [("/garry/good_step", {"data": False})] * 3)
    assert not ros.bridge.log


@asynccontextmanager
async def working_beside(ros, garry):
    """Run a robot that publishes on the original's topics beside a base that cannot drive."""
    async with serve_garry(garry):
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-W", "error", "-m", "robot", "--base", "null", "--child"),
            *("--server", garry.url.replace("ws:", "http:").removesuffix("/ws/robot/")),
            *("--original-topics", "--ros-url", ros.url),
            cwd=ROOT,
            env=os.environ | {"GARRY_ROBOT_TOKEN": TOKEN},
            stdin=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            await garry.until_hello(1)
            yield process
        finally:
            process.stdin.close()
            _, said = await process.communicate()
        assert process.returncode == 0, said
        assert b"Traceback" not in said


def hear_good_steps(ros):
    heard = []
    for topic, kind in (("feedback_type", "std_msgs/String"), ("good_step", "std_msgs/Bool")):
        ros.bridge.graph.subscribe(f"/garry/{topic}", kind, lambda said: heard.append(said["data"]))
    return heard


async def until_heard(heard, *said):
    """Wait until the last that was heard is this."""
    await asyncio.to_thread(wait_until, lambda: heard[-len(said) :] == list(said))


ENDS: dict[str, dict[str, Any]] = {
    "stop": {"type": "stop"},
    "pause": {"type": "state", "state": "paused"},
    "finish": {"type": "state", "state": "finished"},
    "no page": {"type": "heartbeat", "watched": False},
    "off": {"type": "cue", "cue": CUE | {"intensity": 0}},
    "next session": {"type": "welcome", "session": None},
}


@pytest.mark.server
@pytest.mark.parametrize(
    "how",
    ["stop", "silence", "end"]
    + [pytest.param(how, marks=pytest.mark.long) for how in ENDS if how != "stop"],
)
async def test_the_original_s_nodes_are_told_to_end_where_our_robot_may_not_act(ros, how):
    garry, heard = FakeGarry(), hear_good_steps(ros)
    garry.welcome |= {"valence": "positive", "watched": True}
    async with working_beside(ros, garry) as process:
        await until_heard(heard, False)
        await garry.walk(0, 1, 2, 3, 4, 5)
        await until_heard(heard, True)
        since_s = time.monotonic()
        if how == "silence":
            garry.beats = False
        elif how == "end":
            process.stdin.close()
        else:
            await garry.tell(**ENDS[how])
        await until_heard(heard, False)
        assert time.monotonic() - since_s < (1.0 if how == "silence" else 0.4)
        if how not in ("silence", "end"):
            await garry.walk(6, 7, 8, 9, 10, 11)
        await asyncio.sleep(0.7)
        assert heard.count(True) == 1
        assert heard.count("Positive") >= 1
