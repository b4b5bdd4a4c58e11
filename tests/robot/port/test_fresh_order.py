"""What is sent to a base: the last order while it is fresh; after anything odd, the stop."""

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.port.fresh_order import FreshOrder
from tests.support.extent import examples

STOP, GO, OTHER = b"\xaa\x55stop", b"\xaa\x55go", b"\xaa\x55other"


def order(number, frame=GO, sent_s=10.0, **more):
    return json.dumps({"number": number, "sent_s": sent_s, "frame": frame.hex()} | more).encode()


@pytest.fixture
def fresh_order():
    fresh_order = FreshOrder(STOP)
    assert fresh_order.frame(10.0) == STOP
    fresh_order.store(order(1, STOP), 10.0)
    return fresh_order


def test_an_order_holds_for_a_quarter_of_a_second(fresh_order):
    fresh_order.store(order(2), 10.01)
    assert fresh_order.frame(10.02) == fresh_order.frame(10.25) == GO
    assert fresh_order.frame(10.26) == STOP
    assert fresh_order.counters["lapsed"] == 1


@pytest.mark.parametrize(("sent_s", "frame"), [(0.05, GO), (0.0501, STOP)])
def test_a_clock_may_be_ahead_by_a_twentieth_of_a_second(sent_s, frame):
    fresh_order = FreshOrder(STOP)
    fresh_order.store(order(1, STOP, sent_s=0.0), 0.0)
    fresh_order.store(order(2, sent_s=sent_s), 0.0)
    assert fresh_order.frame(0.0) == frame


def test_the_last_order_wins(fresh_order):
    fresh_order.store(order(2), 10.0)
    fresh_order.store(order(3, OTHER), 10.0)
    assert fresh_order.frame(10.0) == OTHER
    fresh_order.store(order(4, STOP), 10.0)
    assert fresh_order.frame(10.0) == STOP


@pytest.mark.parametrize(
    ("number", "sent_s"),
    [(3, 10.0), (2, 10.0), (-1, 10.0), (4, 9.7), (4, 10.2), (4, -math.inf)],
    ids=["repeated", "reordered", "negative", "stale", "from the future", "not finite"],
)
def test_an_order_that_is_not_new_or_not_of_now(fresh_order, number, sent_s):
    fresh_order.store(order(3, STOP), 10.0)
    assert fresh_order.store(order(number, GO, sent_s, once="aa"), 10.0) == b""
    assert fresh_order.frame(10.0) == STOP
    assert fresh_order.counters["old"] + fresh_order.counters["bad"] == 1


def test_what_was_interrupted_does_not_go_on(fresh_order):
    fresh_order.store(order(2), 10.0)
    assert fresh_order.frame(11.0) == STOP
    fresh_order.store(order(3, GO, 11.0), 11.0)
    assert fresh_order.frame(11.0) == STOP
    assert fresh_order.counters["refused"] == 1
    fresh_order.store(order(4, STOP, 11.0), 11.0)
    fresh_order.store(order(5, GO, 11.0), 11.0)
    assert fresh_order.frame(11.0) == GO
    fresh_order.hold()
    fresh_order.store(order(6, GO, 11.0), 11.0)
    assert fresh_order.frame(11.0) == STOP


def test_what_is_sent_once_is_given_once(fresh_order):
    assert fresh_order.store(order(2, once="0102"), 10.0) == b"\x01\x02"
    assert fresh_order.store(order(2, once="0102"), 10.0) == b""


BAD = [
    b"",
    b"junk",
    b"\xff\xfe",
    b"7",
    b"[]",
    b"null",
    b"{}",
    order("2"),
    order(True),
    order(2.0),
    order(2, sent_s=True),
    order(2, sent_s=math.nan),
    order(2, b""),
    order(2, bytes(65)),
    order(2, once="0" * 200),
    order(2, once="xy"),
    order(2, once=7),
    b"[" * 100_000,
]


@pytest.mark.parametrize("bad", BAD, ids=range(len(BAD)))
def test_what_is_no_order_is_counted(fresh_order, bad):
    assert fresh_order.store(bad, 10.0) == b""
    assert fresh_order.counters["bad"] == 1
    assert fresh_order.frame(10.0) == STOP


@settings(max_examples=examples(300), deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([STOP, GO, OTHER]),
            st.integers(-1, 12),
            st.floats(-0.5, 0.2),
            st.sampled_from([0.0, 0.02, 0.1, 0.3]),
        ),
        max_size=30,
    )
)
def test_it_never_sends_what_is_not_the_freshest_order(told):
    fresh_order, now_s, newest, fresh = FreshOrder(STOP), 10.0, -1, (STOP, -math.inf)
    for frame, number, age_s, pause_s in told:
        sent_s = now_s + age_s
        fresh_order.store(order(number, frame, sent_s), now_s)
        if number > newest and -0.05 <= now_s - sent_s <= 0.25:
            newest, fresh = number, (frame, sent_s)
        now_s += pause_s
        sent = fresh_order.frame(now_s)
        assert sent == STOP or (sent == fresh[0] and now_s - fresh[1] <= 0.25)
