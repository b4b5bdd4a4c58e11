"""Small chunks wait for others, and no valid stride waits for them."""

import numpy as np
import pytest

from rehab.gait import LegSamples, TwoLegDetector
from rehab.gait.signals.buffer import SampleBuffer
from tests.gait.faults.bench import FAULTS, open_walk
from tests.gait.walks import make_walk


def feed(walk, size, look_ahead_s=0.0):
    """Return the strides that each chunk completes, and then those of the end."""
    detector = TwoLegDetector(walk.rate_hz, walk.mass_kg, look_ahead_s=look_ahead_s)
    told = [detector.feed(*chunk) for chunk in walk.chunks(size)]
    return [*told, detector.finish()]


@pytest.mark.parametrize("size", [1, 10, 50])
@pytest.mark.parametrize("look_ahead_s", [0.0, 0.05])
def test_a_stride_is_told_with_the_chunk_that_completes_it(size, look_ahead_s):
    walk, _ = make_walk(rate_hz=1000, strides=12)
    told = feed(walk, size, look_ahead_s)
    late_s = [
        # Of its crossing, which lies before its sample, and stamps that jitter.
        walk.t_s[number * size] - (stride.terminal_contact_s + look_ahead_s)
        for number, strides in enumerate(told[:-1])
        for stride in strides
        if stride.valid
    ]

    assert len(late_s) > 20
    assert max(late_s) < 0.002


@pytest.mark.parametrize("size", [5, 20])
@pytest.mark.parametrize(
    "fault", ["none", "drag 50 N, whole swing", "scuff 150 N", "stall 50 ms", "loss 60 ms"]
)
@pytest.mark.parametrize("name", ["moore", "slow 200 Hz"])
def test_no_valid_stride_waits(name, fault, size, monkeypatch):
    """Against a detector that looks at each chunk when it comes."""
    walk, clean = open_walk(name)
    spoiled = FAULTS[fault](walk, clean)
    waiting = feed(spoiled, size)
    monkeypatch.setattr("rehab.gait.detector.LONGEST_WAIT_S", 0.0)
    looking = feed(spoiled, size)

    assert [s for told in waiting for s in told] == [s for told in looking for s in told]
    for late, soon in zip(waiting, looking, strict=True):
        assert [s for s in late if s.valid] == [s for s in soon if s.valid]


def test_most_chunks_are_not_looked_at(monkeypatch):
    walk, _ = make_walk(rate_hz=1000, strides=12)
    looks = []
    accept = SampleBuffer.accept

    def count_look(own):
        looks.append(own.waiting)
        accept(own)

    monkeypatch.setattr(SampleBuffer, "accept", count_look)
    feed(walk, 1)

    assert len(looks) < 0.05 * len(walk.t_s)


def test_samples_that_wait_are_their_own():
    """A sender may use its arrays again."""
    walk, _ = make_walk(strides=12)
    detector = TwoLegDetector(walk.rate_hz, walk.mass_kg)
    found = []
    for t_s, left, right in walk.chunks(5):
        chunk = np.array([t_s, *left[:3], *right[:3]])
        found += detector.feed(chunk[0], LegSamples(*chunk[1:4]), LegSamples(*chunk[4:]))
        chunk[:] = np.nan

    assert found + detector.finish() == walk.both_legs(look_ahead_s=0.0)


@pytest.mark.parametrize("phase", [0, 1, 2, 3])
def test_channels_that_come_and_go_beside_a_gap(phase):
    """Samples are held back while their channels change twice."""
    walk, _ = make_walk(strides=12)
    lost = np.abs(walk.t_s - 5.0) < 0.1
    detector = TwoLegDetector(walk.rate_hz, walk.mass_kg)
    found = []
    for number in np.flatnonzero(~lost):
        part = slice(number, number + 1)
        left = LegSamples(*walk.left[:, part])
        if number % 4 == phase:
            left = left._replace(position_m=walk.t_s[part])
        found += detector.feed(walk.t_s[part], left, LegSamples(*walk.right[:, part]))

    assert sum(stride.valid for stride in found) > 15


def test_chunks_without_samples():
    walk, _ = make_walk(strides=12)
    detector = TwoLegDetector(walk.rate_hz, walk.mass_kg)
    none = np.empty(0)
    nothing = (none, LegSamples(none, none, none), LegSamples(none, none, none))
    found = []
    for chunk in walk.chunks(5):
        found += detector.feed(*nothing) + detector.feed(*chunk)

    assert found + detector.finish() == walk.both_legs(look_ahead_s=0.0)
