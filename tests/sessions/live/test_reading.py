"""Frames of JSON are read by msgspec as by Python, and steps at once as in their turn."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rehab.sessions.events.event import to_text
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.consumers.source import SourceConsumer
from rehab.sessions.live.protocol.messages import read_frame, read_report, read_seen
from rehab.sessions.live.protocol.step_frames import read_single_step, read_steps
from rehab.sessions.log import Step
from robot.wire.frames import BadFrame, read_object, read_whole
from tests.support.callers import turns
from tests.support.json_values import ANYTHING

VALUES = st.dictionaries(st.sampled_from(["type", "a", "b"]), ANYTHING)


def outcome(read: Any, text: str) -> str:
    """Return what was read, to the last digit, or why not."""
    try:
        return repr(read(text))
    except BadFrame as problem:
        return f"refused: {problem}"


@given(VALUES.map(json.dumps) | st.text(max_size=40))
@example('{"a":18446744073709551616}')
@example('{"a":-9223372036854775809}')
@example('{"a":1760000000123456789}')
@example('{"a":NaN}')
@example('{"a":-Infinity}')
@example('{"a":1e400}')
@example('{"a":1,"a":2}')
@example('{"a":"\\ud800"}')
@example('{"type":1}')
@example("[1]")
@example("{}{}")
@example("[" * 3000)
@example('{"a":1.7976931348623157e308,"b":5e-324}')
@example(" " * 65_537)
def test_msgspec_reads_what_python_reads(text):
    assert outcome(read_frame, text) == outcome(read_object, text)


STEP = {"type": "step", "number": 3, "time_s": 1.5, "side": "left", "value": 2.5}
STEP_VALUES = ANYTHING | st.integers() | st.floats() | st.just({"step_length_m": 0.57, "n": 3})
NAMED = st.dictionaries(st.sampled_from(["a.b", "c", "é", "", "x" * 99]), ANYTHING, max_size=3)


@given(
    st.dictionaries(st.sampled_from([*STEP, "reasons", "extra", "kind"]), STEP_VALUES, max_size=2),
    NAMED | st.none(),
)
@example({"number": 2**31}, None)
@example({"value": 2**70, "time_s": 2**70}, {"n": 2**63})
@example({"value": True}, {"n": -(2**63)})
@example({"reasons": ["flagged"]}, {})
@example({}, {f"n{index}": 1.0 for index in range(100)})
def test_a_step_is_read_at_once_as_it_is_in_its_turn(changed, extra):
    text = json.dumps(STEP | ({} if extra is None else {"extra": extra}) | changed)
    at_once = read_single_step(text)
    if at_once is None:
        return
    assert repr(at_once) == outcome(lambda text: read_steps(read_frame(text))[0][0], text)


def test_a_usual_step_is_read_at_once():
    extra = {"step_length_m": 0.57, "n": 1_760_000_000_123_456_789}
    step = read_single_step(json.dumps(STEP | {"reasons": [], "extra": extra}))
    assert step is not None
    assert step.extra == extra
    assert read_single_step(json.dumps({"type": "steps", "steps": [STEP]})) is None


@pytest.mark.parametrize(
    ("changed", "cure"),
    [
        ({"number": 0}, '"number" is a whole number of 1 or more.'),
        ({"side": None}, '"side" is one of: left, right.'),
        ({"value": "4"}, '"value" is a finite number, or null.'),
        ({"late": 1}, '"late" is true or false.'),
        ({"reasons": ["it slipped"]}, '"reasons" is a list of up to 8 codes'),
        ({"extra": {"n": 2**64}}, "too many digits: send it as a decimal"),
    ],
    ids=str,
)
def test_what_a_step_has_wrong_is_named_with_its_cure(changed, cure):
    with pytest.raises(BadFrame) as refused:
        read_steps(STEP | changed)
    assert cure in str(refused.value)


@given(
    st.fixed_dictionaries(
        {"type": st.just("seen") | ANYTHING}, optional={"frame": st.integers() | ANYTHING}
    )
)
@example({"type": "seen", "frame": True})
@example({"type": "seen", "frame": 2.0})
@example({"type": "seen", "frame": -1})
@example({"type": "seen", "frame": 2**31})
def test_what_a_page_has_seen_is_read_at_once_as_it_is_in_its_turn(message):
    text = json.dumps(message)
    if (at_once := read_seen(text)) is not None:
        in_turn = read_frame(text)
        assert in_turn["type"] == "seen"
        assert at_once == read_whole(in_turn, "frame", low=0)


def test_usual_words_of_what_is_seen_are_read_at_once():
    assert read_seen('{"type":"seen","frame":8}') == 8
    assert read_seen('{"type":"change","frame":8}') is None


@pytest.mark.parametrize("field", [{"look": ["wave"]}, {"lights": "off"}])
def test_what_a_report_has_wrong_is_named_with_its_cure(field):
    pose = {"x_m": 0, "y_m": 0, "heading_rad": 0}
    status = {"kind": "status", "base": "twin", "state": "idle", "reason": "", "pose": pose}
    read_report({"report": status})
    with pytest.raises(BadFrame) as refused:
        read_report({"report": status | field})
    (name,) = field
    assert f'"{name}" is a list of 2: ' in str(refused.value)


def test_binary_frames_are_refused():
    with pytest.raises(BadFrame, match="text frames"):
        read_frame(None)


def is_finite(value: Any) -> bool:
    text = json.dumps(value)
    return not any(word in text for word in ("NaN", "Infinity"))


@given(VALUES.filter(is_finite))
@example({"a": 2**70})
@example({"a": "\ud800"})
@example({"a": 1e16, "b": -0.0})
@example({"a": 2**63 - 1, "b": (1, 2)})
def test_what_is_written_is_read_again_as_it_was(message):
    def without_tuples(value: Any) -> Any:
        return json.loads(json.dumps(value))

    assert json.loads(to_text(message)) == without_tuples(message)


def test_no_browser_is_sent_what_is_no_json():
    assert to_text({"value": math.nan}) == '{"value":null}'


async def test_a_step_is_recorded_at_once_only_in_its_turn(place, sourced, monkeypatch):
    """In its turn: the next number, nothing before it in the queue, nobody who subscribes."""
    taken: list[tuple[str, bool]] = []
    handle_now = SourceConsumer.handle_now

    def note(self: SourceConsumer, text: str) -> bool:
        taken.append((json.loads(text)["type"], handle_now(self, text)))
        return taken[-1][1]

    monkeypatch.setattr(SourceConsumer, "handle_now", note)
    session, source = await sourced(place)
    await source.walk(4.0)
    assert taken[-1] == ("step", True)
    live = await runtimes.current().session(session.pk)
    step = {"type": "step", "time_s": 9.0, "side": "left", "value": 4.0}
    await source.say({**step, "number": 1})  # stored with another time: a conflict, as ever
    assert taken[-1] == ("step", False)
    assert (await source.sent_away())[1]["code"] == "conflict"
    source = await place.source().open(last=1)
    with live.gate.closed():
        await source.say({**step, "number": 2})
        await source.say({**step, "number": 3})
        await turns()
        assert (live.next_number, taken[-1]) == (2, ("step", False))
    await source.acked(3)
    await source.say({**step, "number": 4})
    assert (live.next_number, taken[-1]) == (5, ("step", True))
    await source.acked(4)
    assert [one.number async for one in Step.everywhere.filter(session=session)] == [1, 2, 3, 4]
