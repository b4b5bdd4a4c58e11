"""The frame filter: what it believes of a line that loses and changes bytes."""

from __future__ import annotations

import math
import random

import pytest

from robot.bases.kobuki_protocol.feedback import CoreSensors, Feedback, Inertia, Version
from robot.bases.kobuki_protocol.frame_filter import Estimate, FrameFilter
from robot.bases.kobuki_protocol.frames import FRAME_S
from robot.bases.kobuki_protocol.wheels import TICK_M
from tests.support import kobuki_damage as damage

# --- the frame filter ----------------------------------------------------------------------------


class Line:
    """A base that is heard 50 times a second."""

    def __init__(self):
        self.frame_filter = FrameFilter()
        self.now_s = 100.0

    def hear(self, said, after_s=FRAME_S):
        self.now_s += after_s
        return self.frame_filter.update(said, self.now_s)


@pytest.fixture
def line():
    line = Line()
    line.hear(still(0))
    line.hear(still(1))
    return line


def still(number, angle=0, rate=0, **core):
    return Feedback(
        core=CoreSensors(time_ms=20 * number % 65536, **core), inertia=Inertia(angle, rate)
    )


def test_it_begins_with_two_frames():
    line = Line()
    assert line.hear(still(0)) is None
    assert line.hear(still(1)) == Estimate(battery_v=16.7, restarted=True)
    assert line.hear(still(2)) == Estimate(battery_v=16.7)


def test_distances_and_headings_do_not_wrap():
    line, seen, count = Line(), None, 4000
    for number in range(count):
        said = still(
            number,
            angle=(number * 200 + 18_000) % 36_000 - 18_000,
            left_ticks=-47 * number % 65536,
            right_ticks=60 * number % 65536,
        )
        seen = line.hear(said)
        assert seen is None or not seen.restarted or number == 1
    assert seen.left_m == pytest.approx(-47 * (count - 1) * TICK_M)
    assert seen.right_m == pytest.approx(60 * (count - 1) * TICK_M)
    assert seen.heading_rad == pytest.approx(math.radians(2 * (count - 1)))
    assert seen.left_m_s == pytest.approx(-47 * TICK_M / FRAME_S)
    assert line.frame_filter.doubted == 0


def test_an_angle_may_also_wrap_as_a_number_of_16_bits(line):
    line.frame_filter.reset()
    for number, angle in enumerate((32_700, 32_750, -32_736, -32_686)):
        seen = line.hear(still(number, angle=angle))
    assert seen.heading_rad == pytest.approx(math.radians(1.5))


@pytest.mark.parametrize(
    "field", ["bumper", "wheel_drop", "cliff", "over_current", "buttons"], ids=str
)
def test_bits_count_in_two_frames_running(line, field):
    assert getattr(line.hear(still(2, **{field: 1})), field) == 0
    assert getattr(line.hear(still(3)), field) == 0
    assert getattr(line.hear(still(4, **{field: 1})), field) == 0
    assert getattr(line.hear(still(5, **{field: 1})), field) == 1
    assert getattr(line.hear(still(6)), field) == 1
    assert getattr(line.hear(still(7, **{field: 1})), field) == 1
    assert getattr(line.hear(still(8)), field) == 1
    assert getattr(line.hear(still(9)), field) == 0


@pytest.mark.parametrize(
    "broken",
    [
        {"left_ticks": 600},
        {"right_ticks": 0x8000},
        {"angle": 5000},
        {"rate": 32000},
    ],
    ids=str,
)
def test_a_jump_is_put_aside(line, broken):
    assert line.hear(still(2, bumper=1, **broken)) is None
    assert line.hear(still(3, bumper=1)).bumper == 0
    assert line.frame_filter.doubted == 1


@pytest.mark.parametrize("ahead_ms", [-20_000, -1, 256, 30_000])
def test_a_wrong_time_stamp_changes_nothing(line, ahead_ms):
    wrong = Feedback(core=CoreSensors((40 + ahead_ms) % 65536), inertia=Inertia(0, 0))
    line.hear(wrong)
    after = line.hear(still(3, left_ticks=20, right_ticks=20))
    assert not after.restarted
    assert after.left_m == 20 * TICK_M


def test_a_frame_that_comes_twice_counts_once(line):
    line.hear(still(2))
    assert line.hear(still(3, buttons=1)).buttons == 0
    assert line.hear(still(3, buttons=1)) is None
    assert line.hear(still(4)).buttons == 0


def test_a_base_that_was_switched_off_goes_on_from_where_it_was(line):
    there = line.hear(still(2, left_ticks=40, right_ticks=40))
    assert line.hear(still(0, left_ticks=30_000, angle=9000)) is None
    again = line.hear(still(1, left_ticks=30_000, angle=9000))
    assert again.restarted
    assert (again.left_m, again.heading_rad) == (there.left_m, there.heading_rad)
    assert not line.hear(still(2, left_ticks=30_000, angle=9000)).restarted


def test_after_a_long_silence_it_begins_anew(line):
    assert line.hear(still(2), after_s=2) is None
    assert line.hear(still(3)).restarted


def test_versions_count_once_two_replies_agree(line):
    for number, patch, believed in [(2, 4, None), (3, 5, None), (4, 5, Version(1, 1, 5))]:
        said = still(number)
        line.hear(Feedback(said.core, inertia=said.inertia, firmware=Version(1, 1, patch)))
        assert line.frame_filter.firmware == believed


@pytest.mark.parametrize("lose", [damage.lose_bytes, damage.lose_a_byte])
def test_a_lost_byte_costs_its_own_frame(lose):
    assert damage.keep_share(random.Random(1), 5000, lose) >= 0.98


def test_damage_changes_nothing():
    """The short version of tests/bench/test_kobuki_damage.py."""
    life = damage.live_through(random.Random(2), 8000)
    assert life.fooled_checksum > 0
    assert life.wrong == []
