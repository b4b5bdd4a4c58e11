"""The bookkeeping of a source: numbers, window, what is sent again. No sockets."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rehab.sources.client import (
    LiveFeed,
    StepQueue,
    StepsLost,
    UnsendableStride,
    write_step,
)
from rehab.training.steps import Measurement, Side
from robot.wire.limits import MAX_EXTRA, MAX_STEPS


def stride(number=1, value=4.0, **more):
    return Measurement(number=number, time_s=1.5 * number, side=Side.LEFT, value=value, **more)


def outbox_with(strides, session=7, begin=1):
    queue = StepQueue()
    queue.join(session, begin)
    for number in range(1, strides + 1):
        queue.add(stride(number))
    return queue


def take_numbers(queue):
    numbers = []
    while frame := queue.next_frame():
        numbers += [step["number"] for step in frame.get("steps", [frame])]
    return numbers


def test_a_stride_is_written_as_the_protocol_says():
    assert write_step(stride(value=4.02), 12) == {
        "number": 12,
        "time_s": 1.5,
        "side": "left",
        "value": 4.02,
    }
    assert write_step(stride(reasons=("flagged",), extra={"belt": 0.99}), 1) == {
        "number": 1,
        "time_s": 1.5,
        "side": "left",
        "value": 4.0,
        "reasons": ["flagged"],
        "extra": {"belt": 0.99},
    }


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_a_value_that_json_cannot_write_is_null_with_its_reason(value):
    step = write_step(stride(value=value), 1)

    assert step["value"] is None
    assert step["reasons"] == ["not_finite"]
    json.dumps(step, allow_nan=False)


@pytest.mark.parametrize(
    "more",
    [
        {"extra": {"belt speed": 1.0}},
        {"extra": {"ä": 1.0}},
        {"extra": {"x" * 65: 1.0}},
        {"extra": {f"c{n}": 1.0 for n in range(MAX_EXTRA + 1)}},
        {"reasons": ("not good",)},
        {"reasons": tuple("abcdefghi")},
    ],
)
def test_a_stride_that_the_protocol_has_no_room_for_is_refused_with_the_cure(more):
    with pytest.raises(UnsendableStride, match="Rename|Leave columns out"):
        write_step(stride(**more), 1)


@pytest.mark.parametrize("value", [4.0, math.inf])
@pytest.mark.parametrize("count", range(9))
def test_as_many_reasons_as_fit_leave_room_for_ours(count, value):
    own = tuple("abcdefgh"[:count])
    feed, queue = LiveFeed(), StepQueue()
    feed.start_session(Side.LEFT)
    feed.resume()
    feed.pause()
    queue.join(7, 1)
    feed.put(stride(value=value, reasons=own))
    walked = feed.poll(0)
    assert isinstance(walked, Measurement)
    queue.add(walked)

    ours = ["paused"] if value == 4.0 else ["paused", "not_finite"]
    assert queue.next_is_paused
    assert queue.next_frame()["reasons"] == [*own[: 8 - len(ours)], *ours]


def test_a_new_run_goes_on_where_the_server_is():
    queue = outbox_with(3, begin=41)

    assert take_numbers(queue) == [41, 42, 43]
    assert queue.last == 43


def test_one_step_goes_alone_and_several_go_together():
    queue = outbox_with(1)
    assert queue.next_frame()["type"] == "step"
    queue.add(stride(2))
    queue.add(stride(3))
    assert [step["number"] for step in queue.next_frame()["steps"]] == [2, 3]
    assert queue.next_frame() is None


def test_an_ack_covers_all_steps_up_to_its_number():
    queue = outbox_with(5)
    take_numbers(queue)
    queue.acknowledge(3)

    assert (queue.unacknowledged, queue._sent) == (2, 2)
    queue.acknowledge(2)  # late, and covered already
    assert queue.unacknowledged == 2
    queue.acknowledge(5)
    assert queue.unacknowledged == 0


def test_no_more_than_the_window_is_on_the_way():
    queue = outbox_with(1000)

    assert take_numbers(queue) == list(range(1, MAX_STEPS + 1))
    queue.acknowledge(10)
    assert take_numbers(queue) == list(range(MAX_STEPS + 1, MAX_STEPS + 11))
    assert queue._sent == MAX_STEPS


def test_steps_with_much_to_say_are_spread_over_frames():
    queue = StepQueue()
    queue.join(7, 1)
    extra = {f"{'x' * 60}{n:02}": -1.2345678901234567e-300 for n in range(MAX_EXTRA)}
    for number in range(1, 257):
        queue.add(stride(number, extra=extra))
    sizes = []
    while frame := queue.next_frame():
        sizes.append(len(json.dumps(frame)))

    assert queue._sent == 256
    assert max(sizes) <= 64 * 1024
    assert len(sizes) < 25


def test_after_a_drop_it_sends_from_next_and_what_the_server_has_only_seen_once_more():
    queue = outbox_with(10)
    take_numbers(queue)
    queue.acknowledge(4)
    queue.join(7, 8)  # 5 to 7 arrived, but whether they are on the disk nobody said

    assert queue.unacknowledged == 6
    assert take_numbers(queue) == [7, 8, 9, 10]
    queue.join(7, 5)  # they were not: the server has died
    assert take_numbers(queue) == [5, 6, 7, 8, 9, 10]


def test_when_only_the_last_ack_was_lost_the_last_step_asks_for_it():
    queue = outbox_with(3)
    take_numbers(queue)
    queue.join(7, 4)

    assert take_numbers(queue) == [3]
    queue.acknowledge(3)
    assert queue.unacknowledged == 0


def test_a_server_that_forgot_what_it_acknowledged_is_found_out():
    queue = outbox_with(10)
    take_numbers(queue)
    queue.acknowledge(8)

    with pytest.raises(StepsLost, match="wants step 5.*acknowledged up to 8.*new run"):
        queue.join(7, 5)


def test_steps_that_another_source_gave_meanwhile_are_not_written_over():
    queue = outbox_with(3)
    take_numbers(queue)
    queue.join(7, 9)
    queue.add(stride(4))

    # The last of ours tells both sides whether it is still the same.
    assert take_numbers(queue) == [3, 9]


def test_before_its_first_step_a_run_follows_every_welcome():
    queue = StepQueue()
    queue.join(7, 1)
    queue.join(7, 20)
    assert queue.add(stride()) == 20


def test_the_next_session_begins_anew():
    queue = outbox_with(5)
    take_numbers(queue)
    queue.acknowledge(3)

    assert queue.leave() == 2
    assert queue.last == 0
    queue.join(8, 1)
    assert queue.add(stride()) == 1
    assert take_numbers(queue) == [1]


def test_what_was_refused_goes_out_again():
    queue = outbox_with(3)
    take_numbers(queue)
    queue.rewind()
    assert take_numbers(queue) == [1, 2, 3]


@given(st.lists(st.sampled_from(["give", "take", "commit", "drop", "crash", "lose"]), max_size=300))
def test_whatever_happens_every_step_is_stored_once_and_in_order(happenings):
    """The other side commits what it has seen later or, when it dies, never."""
    queue = StepQueue()
    queue.join(7, 1)
    seen, committed, given_count = 0, 0, 0

    def deliver(frame):
        nonlocal seen
        for step in frame.get("steps", [frame]):
            assert step["number"] <= seen + 1, "a gap"
            assert step["time_s"] == step["number"] * 1.5, "another content"
            seen = max(seen, step["number"])

    for happening in happenings:
        match happening:
            case "give":
                given_count += 1
                assert queue.add(stride(given_count)) == given_count
            case "take" if frame := queue.next_frame():
                deliver(frame)
            case "lose" if queue.next_frame():  # sent, never arrived: the connection is gone
                queue.join(7, seen + 1)
            case "commit":
                committed = seen
                queue.acknowledge(committed)
            case "drop":
                queue.join(7, seen + 1)
            case "crash":
                seen = committed
                queue.join(7, seen + 1)
        assert queue._sent <= MAX_STEPS
    queue.join(7, seen + 1)
    while frame := queue.next_frame():
        deliver(frame)
    queue.acknowledge(seen)

    assert seen == given_count
    assert queue.unacknowledged == 0
