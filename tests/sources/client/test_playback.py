"""Who walks when: true cadence, standing still, full speed. Time is a number."""

import math

import pytest

from rehab.sources.client import PlaybackClock, StridePlayback
from rehab.sources.client.playback import UNSENT_MAX
from rehab.training.phases import make_phase
from rehab.training.steps import Measurement, Side


class Time:
    def __init__(self):
        self.now_s = 100.0

    def __call__(self):
        return self.now_s


@pytest.fixture
def ours():
    return Time()


def due(playback, unacknowledged=0) -> Measurement:
    """Return the stride that must be due now."""
    stride = playback.poll(unacknowledged)
    assert isinstance(stride, Measurement)
    return stride


def steady(times_s, phases=None):
    """Walk at these times; write down the phases."""
    left = list(enumerate(times_s, start=1))

    def walk(display):
        if phases is not None:
            phases.append(display.phase.kind)
        if not left:
            return None
        number, time_s = left.pop(0)
        return Measurement(number=number, time_s=time_s, side=Side.LEFT, value=4.0)

    return walk


def make_player(speed, max_unacknowledged, ours, *walks):
    """Make a playback that begins these walks, one after the other."""
    begun = iter(walks)
    return StridePlayback(lambda _side: next(begun), speed, max_unacknowledged, ours)


def test_a_clock_stands_runs_and_stands(ours):
    clock = PlaybackClock(2.0, ours)
    ours.now_s += 10
    assert clock.now_s == 0
    clock.start()
    ours.now_s += 3
    assert clock.now_s == 6
    assert clock.wait_s(10) == 2
    clock.pause()
    ours.now_s += 10
    assert clock.now_s == 6
    clock.start()
    clock.set(50)
    ours.now_s += 1
    assert clock.now_s == 52
    assert clock.wait_s(10) == 0


def test_nobody_walks_before_being_told(ours):
    playback = make_player(1.0, 256, ours, steady([250.0, 251.0]))
    playback.start_session(Side.LEFT)

    assert playback.poll(0) == math.inf
    assert playback.clock_s is None
    assert not playback.is_over


def test_the_first_stride_is_due_at_once_and_the_others_in_time(ours):
    playback = make_player(2.0, 256, ours, steady([250.0, 251.0, 253.0]))
    playback.start_session(Side.LEFT)
    playback.resume()

    assert due(playback).number == 1
    assert playback.clock_s == 250.0
    assert playback.poll(0) == 0.5
    ours.now_s += 0.5
    assert due(playback).number == 2
    ours.now_s += 0.25
    assert playback.poll(0) == 0.75


def test_standing_still_moves_the_rest_of_the_walk(ours):
    playback = make_player(1.0, 256, ours, steady([1.0, 2.0]))
    playback.start_session(Side.LEFT)
    playback.resume()
    playback.poll(0)
    assert playback.poll(0) == 1.0
    ours.now_s += 0.25
    playback.pause()
    ours.now_s += 600
    assert playback.poll(0) == math.inf
    assert playback.clock_s is None
    playback.resume()
    assert playback.clock_s == 1.25
    assert playback.poll(0) == 0.75


def test_the_next_stride_waits_for_news_of_the_phase_but_not_forever(ours):
    phases: list[str] = []
    playback = make_player(1.0, 256, ours, steady([1.0, 2.0, 3.0, 4.0], phases))
    playback.phase = make_phase("baseline")
    playback.start_session(Side.LEFT)
    playback.resume()
    playback.poll(0)
    assert playback.poll(1) == 0.5  # sent, not acknowledged
    ours.now_s += 0.1
    playback.phase = make_phase("training")  # told with the ack
    assert playback.poll(0) == pytest.approx(0.9)
    ours.now_s += 0.9
    assert due(playback).number == 2
    ours.now_s += 0.6  # the server is out of reach: whoever walks walks on
    assert playback.poll(1) == pytest.approx(0.4)

    assert phases == ["baseline", "training", "training"]


def test_at_full_speed_only_acks_hold_it_up(ours):
    playback = make_player(None, 3, ours, steady([1.0, 2.0, 100.0]))
    playback.start_session(Side.LEFT)
    playback.resume()

    assert [due(playback, sent).number for sent in (0, 1, 2)] == [1, 2, 3]
    assert playback.poll(3) == math.inf
    assert [playback.is_over, playback.poll(2), playback.is_over] == [False, math.inf, True]
    assert playback.clock_s is None


def test_memory_is_bounded_when_the_server_stays_away(ours):
    playback = make_player(1.0, 256, ours, steady([1.0]))
    playback.start_session(Side.LEFT)
    playback.resume()

    assert playback.poll(UNSENT_MAX) == math.inf


def test_another_walk_begins_from_its_beginning(ours):
    playback = make_player(1.0, 256, ours, steady([1.0, 2.0]), steady([1.0]))
    playback.start_session(Side.LEFT)
    playback.resume()
    playback.poll(0)
    playback.end_session()
    assert playback.is_over
    playback.start_session(Side.LEFT)
    assert playback.poll(0) == math.inf
    playback.resume()
    assert due(playback).time_s == 1.0
