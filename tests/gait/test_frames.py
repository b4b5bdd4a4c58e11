"""Frame numbers beside the stamps: what is late or lost is known, and wrong numbers are ignored."""

import re
from dataclasses import replace

import numpy as np
import pytest

from rehab.gait import LegSamples, Stride, TwoLegDetector
from rehab.gait.signals.frame_clock import FrameClock
from tests.gait.faults.bench import open_walk
from tests.gait.faults.spoil import lose, stall
from tests.gait.faults.tally import count
from tests.gait.walks import make_walk

RATE_HZ = 100.0


def make_stamps(samples=2000, rate_hz=RATE_HZ, seed=0):
    """Return jittered stamps [s] and frame numbers of a device that misses nothing."""
    rng = np.random.default_rng(seed)
    frames = np.arange(5000.0, 5000 + samples)
    return 20 + (frames - 5000) / rate_hz + rng.normal(0, 0.0003, samples), frames


def run(stamps, frames, size=None):
    """Return the clock, the times, and by how much each sample was late [s]."""
    clock = FrameClock()
    times, lates = [], []
    for first in range(0, len(stamps), size or len(stamps)):
        part = slice(first, first + (size or len(stamps)))
        (known,), late_s = clock.add(np.array([stamps[part]]), 0, frames[part])
        times.append(known)
        lates.append(np.zeros(len(known)) if late_s is None else late_s)
    held = clock.finish()
    if held is not None:
        times.append(held[0])
        lates.append(np.zeros(held.shape[1]))
    return clock, np.concatenate(times), np.concatenate(lates)


def stall_with_loss(walk, clean, *, by_stamp=False):
    """Let samples wait for 80 ms once a stride, and lose 20 ms of them."""
    stalled = stall(walk, clean, 0.08, by_stamp=by_stamp)
    lost = np.zeros(len(walk.t_s), dtype=bool)
    for at in np.flatnonzero(np.diff(stalled.t_s, prepend=0.0) > 0.05):
        first = at + round(0.02 * walk.rate_hz)
        lost[first : first + round(0.02 * walk.rate_hz)] = True
    return replace(
        stalled,
        t_s=stalled.t_s[~lost],
        left=stalled.left[:, ~lost],
        right=stalled.right[:, ~lost],
        frames=np.flatnonzero(~lost).astype(np.float64),
    )


def test_late_and_lost_samples_get_the_times_at_which_they_were_taken():
    true_s, frames = make_stamps()
    stamps = true_s.copy()
    for at in range(200, 1900, 170):  # a stall of 80 ms, in which 20 ms are lost
        stamps[at : at + 8] = true_s[at + 8] + 0.0005 * np.arange(8)
    kept = np.ones(len(stamps), dtype=bool)
    for at in range(200, 1900, 170):
        kept[at + 3 : at + 5] = False
    kept[1000:1050] = False
    clock, times, late_s = run(stamps[kept], frames[kept])

    assert clock.problem == ""
    assert np.abs(times - true_s[kept]).max() < 0.002  # of jitter, ± 0.3 ms
    assert 0.07 < late_s.max() < 0.09


@pytest.mark.parametrize("size", [1, 7, 100])
def test_chunks_do_not_matter(size):
    walk, clean = open_walk("100 Hz")
    spoiled = stall_with_loss(walk, clean)
    whole = run(spoiled.t_s, spoiled.frames)[1:]
    parts = run(spoiled.t_s, spoiled.frames, size)[1:]

    for one, other in zip(whole, parts, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", ["100 Hz", "1 kHz", "slow 200 Hz", "fast 100 Hz"])
def test_losses_in_stalls_are_no_guess_any_more(name):
    walk, clean = open_walk(name)
    spoiled = stall_with_loss(walk, clean)
    numbered = count(spoiled.both_legs(), clean)
    stamped = count(replace(spoiled, frames=None).both_legs(), clean)

    assert numbered.wrong == 0
    assert numbered.worst < 0.03  # noise over the bridge
    assert numbered.lost <= 0.05 * numbered.strides
    assert numbered.contacts_s[-1] < 0.01  # where 20 ms are lost around it
    assert stamped.lost >= 4 * max(1, numbered.lost)


@pytest.mark.parametrize("name", ["moore", "100 Hz"])
def test_inverse_dynamics_by_stamp_is_still_not_shown_where_it_is_late(name):
    walk, clean = open_walk(name)
    spoiled = stall_with_loss(walk, clean, by_stamp=True)

    assert count(spoiled.both_legs(), clean).wrong == 0


def test_numbers_change_nothing_where_nothing_is_late():
    walk, clean = open_walk("100 Hz")
    counted = replace(walk, frames=np.arange(len(walk.t_s), dtype=np.float64))
    tally = count(counted.both_legs(), clean)

    assert (tally.lost, tally.wrong) == (0, 0)
    assert tally.contacts_s[-1] < 0.0025  # of stamps that jitter by 0.3 ms
    assert tally.worst < 0.02


def test_other_channels_from_some_sample_on():
    """Numbers stay with samples that are held back when the table becomes wider."""
    walk, _ = make_walk(strides=12)
    frames = np.arange(len(walk.t_s), dtype=np.float64)
    detector = TwoLegDetector(RATE_HZ, walk.mass_kg)
    found = []
    for first in range(0, len(walk.t_s), 20):
        part = slice(first, first + 20)
        left = LegSamples(*walk.left[:, part])
        if first >= 40:
            left = left._replace(position_m=0.1 * walk.t_s[part])
        right = LegSamples(*walk.right[:, part])
        found += detector.feed(walk.t_s[part], left, right, frame=frames[part])

    assert detector.frame_problem == ""
    assert sum(stride.valid for stride in found) > 15


@pytest.mark.parametrize("missing", [0, 3])
@pytest.mark.parametrize("name", ["100 Hz", "1 kHz"])
def test_numbers_that_begin_in_the_middle_of_a_walk(name, missing):
    """They are used from then on: from the first chunk that has all of them."""
    walk, clean = open_walk(name)
    spoiled = stall_with_loss(walk, clean)
    half = len(spoiled.t_s) // 40 * 20
    found: dict[int, list[Stride]] = {}
    for begins in (half, len(spoiled.t_s)):
        detector = TwoLegDetector(spoiled.rate_hz, spoiled.mass_kg, look_ahead_s=0.05)
        strides = found[begins] = []
        for number, chunk in enumerate(spoiled.chunks(20)):
            first = 20 * number
            numbers = spoiled.frames[first : first + 20].copy()
            numbers[: missing * (first == begins)] = np.nan
            strides += detector.feed(*chunk, frame=numbers if first >= begins else None)
        assert detector.frame_problem == ""
    since_s = spoiled.t_s[half] + 1.5
    later = [stride for stride in clean if since_s < stride.initial_contact_s]
    numbered, stamped = (
        count([stride for stride in strides if since_s < stride.initial_contact_s], later)
        for strides in found.values()
    )

    assert (numbered.lost, numbered.wrong) == (0, 0)
    assert stamped.lost >= 2


def test_wrong_numbers_that_begin_later_are_told():
    walk, clean = open_walk("100 Hz")
    detector = TwoLegDetector(walk.rate_hz, walk.mass_kg)
    found = []
    for number, chunk in enumerate(walk.chunks(20)):
        frame = np.full(len(chunk[0]), 7.0) if number >= 50 else None
        found += detector.feed(*chunk, frame=frame)

    assert "stay as they are" in detector.frame_problem
    assert count(found, clean).lost <= 1


WRONG = {
    "constant": (lambda frames: np.full(len(frames), 7.0), "stay as they are"),
    "of the cameras, ten samples each": (lambda frames: frames // 10, "stay as they are"),
    "backwards": (lambda frames: frames[::-1], "run backwards"),
    "seconds": (lambda frames: frames * 0.01, "not whole"),
    "missing": (lambda frames: np.full(len(frames), np.nan), "missing"),
    "infinite": (lambda frames: np.where(frames % 9, frames, np.inf), "missing"),
    "noise": (lambda frames: np.random.default_rng(0).permutation(frames), "run backwards|count"),
    "a byte": (lambda frames: frames % 256, "began anew 3 times"),
    "not whole later": (lambda frames: frames + 0.5 * (frames > 5500), "not whole"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_numbers_are_ignored_and_told(wrong):
    change, word = WRONG[wrong]
    stamps, frames = make_stamps()
    clock, times, _ = run(stamps, change(frames))

    assert re.search(word, clock.problem)
    assert len(times) == len(stamps)
    assert np.abs(times - stamps).max() < 0.0025


def test_a_count_that_goes_on_where_samples_are_lost_is_ignored():
    """It counts what was sent: by it, each loss would be a stall that never ends."""
    walk, clean = open_walk("100 Hz")
    broken = lose(walk, clean, 0.12)
    counted = replace(broken, frames=np.arange(len(broken.t_s), dtype=np.float64))
    clock, times, late_s = run(counted.t_s, counted.frames)

    assert "go on where samples are lost" in clock.problem
    assert np.abs(times - counted.t_s).max() < 0.002
    assert late_s.max() < 0.002
    assert count(counted.both_legs(), clean).wrong == 0


@pytest.mark.parametrize(("late", "is_believed"), [(64, True), (65, False)])
def test_a_stall_is_believed_for_a_second(late, is_believed):
    """Then the stamps are right: samples are lost, and the count does not tell."""
    number = np.arange(320.0)
    stamps = number / 64
    stamps[128 : 129 + late] += 6 / 64
    stamps[129 + late : 134 + late] = stamps[128 + late]  # the rest comes at once
    clock, times, _ = run(stamps, number)

    assert (clock.problem == "") is is_believed
    assert times.tolist() == pytest.approx(number / 64 if is_believed else stamps)


def test_a_count_may_begin_anew_twice_and_samples_may_come_twice():
    stamps, frames = make_stamps()
    frames[700:] -= 5700  # it was started again
    frames[1300:] += 65536 - 600  # and jumps
    twice = np.sort(np.concatenate((np.arange(2000), [100, 101, 900])))
    clock, times, late_s = run(stamps[twice], frames[twice])

    assert clock.problem == ""
    assert np.abs(times - stamps).max() < 0.0025
    assert late_s.max() == 0


def test_a_count_by_twos_may_begin_anew():
    stamps, frames = make_stamps()
    frames *= 2
    frames[700:] -= 11_400
    clock, times, _ = run(stamps, frames)

    assert clock.problem == ""
    assert np.abs(times - stamps).max() < 0.0025


def test_a_clock_that_is_set():
    stamps, frames = make_stamps()
    stamps[1000:] -= 500
    clock, times, late_s = run(stamps, frames)

    assert clock.problem == ""
    assert np.abs(times - stamps).max() < 0.0025
    assert late_s.max() == 0


def test_stamps_of_a_clock_that_ticks_every_16_ms():
    """By themselves they stand still; with numbers they need not be exact."""
    walk, clean = open_walk("100 Hz")
    ticking = np.floor(walk.t_s / 0.0156) * 0.0156
    frames = np.arange(len(ticking), dtype=np.float64)
    tally = count(replace(walk, t_s=ticking, frames=frames).both_legs(), clean)

    assert count(replace(walk, t_s=ticking).both_legs(), clean).lost == tally.strides
    assert (tally.lost, tally.wrong) == (0, 0)
    assert tally.contacts_s[-1] < 0.012  # by half a tick
