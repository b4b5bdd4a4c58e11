"""Two phones' steps are compared on the server's clock, while that is known well enough."""

from __future__ import annotations

from typing import Any

import pytest

from tests.support.node import run_node

# This phone's clock is 5 s ahead of the server's. We asked, the server read, it was answered.
CLOSE = [[105.0, 100.003, 105.006], [106.0, 101.05, 106.1]]


def compare(exchanges: list[list[float]], contact_error_s: float = 0.004, **more: Any) -> Any:
    wish = {
        "exchanges": exchanges,
        "contacts": [{"at_s": at_s, "error_s": contact_error_s} for at_s in (102.5, 103.8)],
        "strides": [[107.0, 108.2], [108.2, 109.4]],  # 102 to 103.2, to 104.4 by the server's
        "now_s": 109.4,
    }
    return run_node("compare_steps.mjs", wish | more)


def test_steps_are_compared_on_the_servers_clock() -> None:
    read = compare(CLOSE)
    assert read["offset_s"] == pytest.approx(5.0)
    assert read["error_s"] == pytest.approx(0.003 + 50e-6 * 4.394)
    assert read["found"] == pytest.approx([100 * 0.2 / 1.2, 0.0], abs=1e-6)


@pytest.mark.parametrize(
    ("exchanges", "more"),
    [
        ([], {}),
        (CLOSE[1:], {}),  # a slow network: 50 ms
        (CLOSE, {"contact_error_s": 0.008}),
        (CLOSE, {"now_s": 400.0}),  # not asked for minutes: quartz drifts
    ],
    ids=["never asked", "slow", "the other phone's clock", "long ago"],
)
def test_nothing_is_compared_unless_clocks_agree_within_10_ms(exchanges: Any, more: Any) -> None:
    assert compare(exchanges, **more)["found"] == [None, None]


def test_two_contacts_in_a_stride_are_not_compared() -> None:
    assert compare(CLOSE, strides=[[107.0, 109.4]])["found"] == [None]
