"""The original's plain text: numbered and timed by the server, and the PT's goal wins."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from rehab.sessions.live.consumers import source as source_module
from robot.behavior.performer import Performer
from tests.support.callers import SourceCaller, change, rows_of
from tests.support.robot_stage import IdealBase


async def test_plain_text_is_numbered_and_timed_by_the_server(place, begun, monkeypatch):
    clock = SimpleNamespace(monotonic=lambda: 1.0, time=lambda: 1000.5)
    monkeypatch.setattr(source_module, "time", clock)
    session = await begun(place)
    source = await SourceCaller().dial()
    await source.say({"token": place.tokens["source"]})
    await source.say("4.02, 3.0")
    await source.acked(1)
    await source.say(" NaN ,3\n")
    await source.say("inf, 3.9")
    await source.say("2.5,nan")
    await source.acked(4)
    assert await rows_of(session, "number", "time_s", "side", "value", "reasons", "hit") == [
        (1, 1000.5, "left", 4.02, [], True),
        (2, 1000.5, "left", None, ["missing"], None),
        (3, 1000.5, "left", None, ["missing"], None),
        (4, 1000.5, "left", 2.5, [], False),
    ]


@pytest.mark.parametrize("set_s", [0.0, -3600.0, 86_400.0])
async def test_the_time_of_plain_text_never_runs_backwards(place, begun, monkeypatch, set_s):
    wall, ours = [1_800_000_000.0], [50.0]
    clock = SimpleNamespace(monotonic=lambda: ours[0], time=lambda: wall[0])
    monkeypatch.setattr(source_module, "time", clock)
    session = await begun(place)
    source = await place.source().dial()
    for number in (1, 2):
        ours[0] += 1.0
        await source.say("4, 3")
        await source.acked(number)
        wall[0] += 1.0 + set_s  # somebody sets the server's clock; a step does not hear of it
    await source.hang_up()
    ours[0], wall[0] = 5.0, 1_800_000_003.0 + set_s  # another process, after a restart
    source = await place.source().dial()
    for number in (3, 4):
        await source.say("4, 3")
        await source.acked(number)
        ours[0] += 1.0
    first_s = max(wall[0], 1_800_000_001.0)
    assert await rows_of(session, "time_s", "reasons") == [
        (1_800_000_000.0, []),
        (1_800_000_001.0, []),
        (first_s, []),
        (first_s + 1.0, []),
    ]


async def test_a_robot_answers_plain_text(place, begun):
    await begun(place)
    robot = await place.robot().open()
    source = await place.source().dial()
    await source.say("4.02, 3.0")
    step = await robot.hear("step")
    performer = Performer(IdealBase(lambda: 0.0))
    performer.handle(robot.heard[0], 0.0)
    performer.handle(step, 0.0)
    assert (performer.is_linked, performer.bad_messages) == (True, 0)


async def test_the_pts_goal_wins_and_another_one_is_shown_to_the_pt(place, begun):
    session = await begun(place)
    monitor = await place.monitor(session).open()
    tablet = await place.tablet(session).open()
    source = await place.source().dial()
    await source.say("3.5, 3.0")
    await source.acked(1)
    assert not any(event["kind"] == "source_goal" for event in monitor.events)
    await source.say("3.5, 3.9")
    assert (await monitor.until(lambda e: e["kind"] == "source_goal"))["goal"] == 3.9
    await monitor.until_step(2)
    assert not any(event["kind"] == "source_goal" for event in monitor.events[:-2])
    await tablet.until_step(2)
    assert await rows_of(session, "goal", "hit") == [(3.0, True), (3.0, True)]
    assert not any(event["kind"] == "source_goal" for event in tablet.events)


async def test_plain_text_before_a_session_runs_is_refused_with_the_socket_open(place, ready):
    source = await place.source().dial()
    await source.say("4, 3")
    assert (await source.hear("error"))["code"] == "not_running"
    session = await ready(place)
    assert (await source.hear("welcome"))["session"] == session.pk
    await source.say("4, 3")
    assert (await source.hear("error"))["code"] == "not_running"
    await change(session, "start")
    await source.hear("start")
    await source.say("4, 3")
    await source.acked(1)
