"""Whatever frames come: an error with a cure to the sender, the right code, no harm to others."""

from __future__ import annotations

import asyncio
from typing import Any

from django.db import OperationalError

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.log import Step
from rehab.sessions.models import TrainingSession
from robot.wire.limits import MAX_FRAME_BYTES
from tests.support.callers import (
    Message,
    Place,
    a_step,
    change,
    numbers,
    turns,
)

# --- frames that are not the protocol -------------------------------------------------------------

BAD_FRAMES: dict[str, Any] = {
    "too_large": '{"type": "step", "x": "' + "x" * MAX_FRAME_BYTES + '"}',
    "binary": b'{"type": "step"}',
    "empty": "",
    "no_json": "hello?",
    "half_json": '{"type": "step"',
    "array": [1, 2],
    "number": "7",
    "null": "null",
    "text": '"step"',
    "type_number": {"type": 7},
    "type_null": {"type": None},
    "no_type": {"number": 1},
    "unknown_type": {"type": "stride"},
    "seen": {"type": "seen", "frame": 1},
    "second_hello": {"type": "hello", "version": 1, "run": "r", "last": 0},
    "deep_array": "[" * (MAX_FRAME_BYTES // 2) + "]" * (MAX_FRAME_BYTES // 2),
    "deep_extra": '{"type":"step","extra":' + '{"a":' * 9000 + "1" + "}" * 9001,
    "surrogates": '{"type": "\\ud800"}',
    "long_int": '{"type": "step", "number": ' + "9" * 5000 + "}",
    "steps_object": {"type": "steps", "steps": {}},
    "steps_empty": {"type": "steps", "steps": []},
    "steps_missing": {"type": "steps"},
    "steps_many": {"type": "steps", "steps": [a_step(n) for n in range(1, 258)]},
    "steps_of_lists": {"type": "steps", "steps": [[1]]},
    "nan_literal": '{"type":"step","number":2,"time_s":1,"side":"left","value":NaN}',
    "infinity_literal": '{"type":"step","number":2,"time_s":1,"side":"left","value":Infinity}',
    "minus_infinity": '{"type":"step","number":2,"time_s":-Infinity,"side":"left","value":1}',
    "overflow": '{"type":"step","number":2,"time_s":1,"side":"left","value":1e999}',
    "huge_value": a_step(2, 10**400),
    "huge_time": a_step(2, time_s=10**400),
    "time_in_ms": a_step(2, time_s=1.7e12),
    "huge_number": a_step(2) | {"number": 10**400},
    "number_beyond_the_column": a_step(2) | {"number": 2**31},
    "number_bool": a_step(2) | {"number": True},
    "number_float": a_step(2) | {"number": 2.0},
    "number_text": a_step(2) | {"number": "2"},
    "number_zero": a_step(2) | {"number": 0},
    "number_negative": a_step(2) | {"number": -1},
    "time_bool": a_step(2, time_s=True),
    "time_null": a_step(2, time_s=None),
    "time_missing": {"type": "step", "number": 2, "side": "left", "value": 4.0},
    "value_bool": a_step(2, True),
    "value_text": a_step(2, "4.0"),
    "value_list": a_step(2, [4.0]),
    "side_paretic": a_step(2, side="paretic"),
    "side_list": a_step(2, side=["left"]),
    "reasons_text": a_step(2, reasons="slip"),
    "reasons_many": a_step(2, reasons=["slip"] * 9),
    "reasons_of_numbers": a_step(2, reasons=[1]),
    "reasons_with_spaces": a_step(2, reasons=["it slipped"]),
    "extra_list": a_step(2, extra=[1]),
    "extra_text": a_step(2, extra={"a": "b"}),
    "extra_bool": a_step(2, extra={"a": True}),
    "extra_nested": a_step(2, extra={"a": {"b": 1}}),
    "extra_many": a_step(2, extra={f"n{i}": i for i in range(41)}),
    "extra_name": a_step(2, extra={"x" * 65: 1}),
    "plain_words": "four, three",
    "plain_one_number": "4.0",
    "plain_three_numbers": "4, 3, 2",
}


async def test_frames_that_are_not_the_protocol(place, sourced, bystander):
    session, source = await sourced(place)
    await source.walk(4.0)
    for name, bad in BAD_FRAMES.items():
        await source.say(bad)
        code, error = await source.sent_away()
        assert code == 4400, name
        assert len(error["message"]) > 20, name
        source = await place.source().dial()
        assert (await source.hello())["next"] == 2, name
    assert await numbers(session) == [1]
    await source.walk(4.0)


BAD_HELLOS: list[Message] = [
    {"version": 2},
    {"version": None},
    {"version": "1"},
    {"run": ""},
    {"run": "x" * 65},
    {"run": "two words"},
    {"run": 1},
    {"last": -1},
    {"last": None},
    {"last": True},
    {"last": 1.5},
    {"last": 10**400},
    {"session": "7"},
    {"session": True},
    {"session": -1},
    {"session": 10**400},
    {"clock_s": "now"},
    {"clock_s": 10**400},
    {"clock_s": True},
    {"speed": "fast"},
    {"speed": 0},
    {"speed": -1},
    {"speed": False},
]


async def test_hellos_that_are_not_the_protocol(place, begun, bystander):
    await begun(place)
    for bad in BAD_HELLOS:
        source = await place.source().dial()
        await source.say({"type": "hello", "version": 1, "run": "r", "last": 0} | bad)
        code, error = await source.sent_away()
        assert code == 4400, bad
        assert len(error["message"]) > 15, bad


async def test_steps_before_hello(place, begun):
    await begun(place)
    source = await place.source().dial()
    await source.say(a_step(1))
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4400, "no_hello")


async def test_what_is_no_hello_of_a_robot(place, begun, bystander):
    await begun(place)
    frames: tuple[Any, ...] = (
        {"type": "hello"},
        {"type": "hello", "base": 1},
        {"type": "step"},
        {},
        [],
        b"x",
        "no",
        {"type": "report", "report": []},
        {"type": "report", "report": {"x": "x" * 9000}},
        '{"type": "report", "report": {"x": 1e999}}',
        '{"type": "report", "report": {"x": NaN}}',
        '{"type": "report", "report": {"x": ' + "[" * 900 + "]" * 900 + "}}",
    )
    for bad in frames:
        robot = await place.robot().dial()
        await robot.say(bad)
        code, error = await robot.sent_away()
        assert code == 4400, bad
        assert len(error["message"]) > 15, bad


async def test_a_robots_bad_report_does_not_reach_the_monitor(place, begun):
    session = await begun(place)
    monitor = await place.monitor(session).open()
    for bad in ("1e999", "[" * 900 + "]" * 900):
        robot = await place.robot().open()
        await robot.say('{"type": "report", "report": {"x": ' + bad + "}}")
        assert (await robot.sent_away())[0] == 4400
    robot = await place.robot().open()
    await robot.say({"type": "report", "report": {"pose": [0, 1, 0.5], "word": "ok"}})
    report = await monitor.until(lambda event: event["kind"] == "robot")
    assert report["report"] == {"pose": [0, 1, 0.5], "word": "ok"}


async def test_what_pages_may_not_say(place, begun, bystander):
    session = await begun(place)
    frames: tuple[Any, ...] = (
        {"type": "step"},
        {"type": "seen"},
        {"type": "seen", "frame": True},
        {"type": "seen", "frame": -1},
        {"type": "seen", "frame": "1"},
        "x",
        b"x",
        [],
    )
    for bad in frames:
        for page in (place.tablet(session), place.monitor(session)):
            await page.watch()
            await page.say(bad)
            code, error = await page.sent_away()
            assert code == 4400, bad
            assert len(error["message"]) > 15, bad
    tablet = await place.tablet(session).open()
    values = {"goal": 5, "words_shown": 0, "chart_style": "line", "robot_intensity": 0}
    for kind in ("start", "resume", "finish", "abort", "valence", *values):
        value = {"value": values.get(kind, "binary")} if kind in {"valence", *values} else {}
        await tablet.say({"type": "change", "kind": kind, "id": kind, **value})
        refusal = await tablet.hear("error")
        assert (refusal["code"], refusal["id"]) == ("refused", kind)
    await tablet.say({"type": "change", "kind": "pause", "id": "p"})
    assert (await tablet.hear("done"))["id"] == "p"
    await change(session, "resume")
    changes: tuple[Message, ...] = (
        {"kind": "goal", "value": 4},
        {"kind": "goal", "value": True, "id": "x"},
        {"kind": "goal", "value": "4", "id": "x"},
        {"kind": "goal", "value": 10**400, "id": "x"},
        {"kind": "dance", "id": "x"},
        {"kind": ["goal"], "id": "x"},
        {"kind": None, "id": "x"},
        {"kind": "goal", "value": 4, "id": "two words"},
        {"kind": "feedback_text", "value": "Go!", "id": "x"},
        {"kind": "valence", "value": None, "id": "x"},
        {"kind": "valence", "value": 3, "id": "x"},
        {"kind": "chart_style", "value": {}, "id": "x"},
    )
    for bad in changes:
        monitor = await place.monitor(session).open()
        await monitor.say({"type": "change", **bad})
        code, error = await monitor.sent_away()
        assert code == 4400, bad
    assert (await TrainingSession.everywhere.aget(pk=session.pk)).goal == 3.0


async def test_changes_that_cannot_be_are_refused_in_words(place, begun):
    session = await begun(place)
    monitor = await place.monitor(session).open()
    for kind, value, words in (
        ("goal", 0, "above 0"),
        ("goal", None, "needs a value"),
        ("gain", 9, "0.5 to 1.5"),
        ("phase", 1, "no phase 1"),
        ("phase", 1e300, "no phase"),
        ("activation_threshold", -1, "more than 0 and up to 200 %"),
        ("robot_intensity", 0.3, "normal (1), gentle (0.5), off (0)"),
        ("robot_intensity", None, "needs a value"),
        ("resume", None, "must be paused"),
        ("start", None, "must be ready"),
    ):
        answer = await monitor.change(kind, value)
        assert (answer["type"], answer["code"]) == ("error", "refused"), kind
        assert words in answer["message"]
    assert (await monitor.change("pause"))["type"] == "done"
    assert monitor.code is None


async def test_pages_whose_session_fails_are_told_to_come_back(place: Place, sourced, bystander):
    """A number that was written behind the server's back: the session is rebuilt from its log."""
    session, source = await sourced(place)
    tablet, robot = await place.tablet(session).open(), await place.robot().open()
    await source.walk(4.0)
    first = await Step.everywhere.aget(session=session)
    first.pk, first.number, first.value = None, 2, 9.0
    await first.asave(force_insert=True)
    await source.say(a_step(2, 4.0))
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4011, "not_stored")
    assert (await tablet.sent_away())[0] == 4012
    assert (await robot.sent_away())[0] in (4011, 4012)
    again = await place.source().dial()
    assert (await again.hello())["next"] == 3
    await again.walk(4.0)
    assert await numbers(session) == [1, 2, 3]


async def test_a_source_is_let_into_no_session_that_was_dropped_meanwhile(place, sourced, stall):
    session, source = await sourced(place)
    await source.walk(4.0)
    live = await runtimes.current().session(session.pk)
    stall.begin()
    await source.say(a_step(2))
    await turns()
    await place.tablet(session).dial()
    while live.gate.is_open:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    again = await place.source().dial()  # it gives up waiting, and waits for the page to join
    await again.say({"type": "hello", "version": 1, "run": "r1", "last": 2})
    while not live.gate._turn.locked():  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    stall.problem = OperationalError("database is locked")
    stall.end()
    assert (await again.hear("welcome"))["next"] == 2
    stall.problem = None
    again.number = 1
    await again.walk(4.0, 4.0)
    assert await numbers(session) == [1, 2, 3]


async def test_whoever_is_in_a_dropped_session_hears_of_its_end(place, begun, stall):
    session = await begun(place)
    source, tablet = await place.source().open(), await place.tablet(session).open()
    await source.walk(4.0)
    del runtimes.current().sessions[session.pk]
    stall.problem = OperationalError("database is locked")
    await source.say(a_step(2))
    assert (await source.sent_away())[0] == 4011
    assert (await tablet.sent_away())[0] == 4012
    stall.problem = None
    assert (await (await place.source().dial()).hello())["next"] == 2
