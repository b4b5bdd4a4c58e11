"""Worn sensors on all recordings that there are: contacts, strides, signs, turns, angles."""

from __future__ import annotations

import csv
import gzip
from collections import Counter

import numpy as np
import pytest

from rehab.gait import WearableDetector, WearableStride
from tests.support.data import signals
from tests.support.other_walkers import OTHERS
from tests.support.simulated_leg import random_mounting
from tests.support.worn_sensors import (
    GAITMAP_HZ,
    STARTS_S,
    Floats,
    Walk,
    captured_walks,
    count_cycles,
    find_contacts,
    match,
    measure,
    stroke_walks,
    turning_walks,
)

pytestmark = pytest.mark.bench


def describe(late_s: Floats) -> str:
    """Return mean and spread [ms], and how many are missed."""
    late = 1000 * late_s
    missed = int(np.isnan(late_s).sum())
    return f"{np.nanmean(late):5.1f} ± {np.nanstd(late):4.1f} ms, {missed} of {len(late)} missed"


def count_extra(strides: list[WearableStride], walk: Walk) -> int:
    """Return how many contacts of strides that count are none, while the reference walks."""
    counted, _ = find_contacts([one for one in strides if not one.reasons])
    inside = (counted > walk.initial_s[0]) & (counted < walk.initial_s[-1])
    return int(np.isnan(match(walk.initial_s, counted[inside])).sum())


@pytest.mark.parametrize("rate_hz", [GAITMAP_HZ, 100, 60, 50])
def test_foot_against_motion_capture(rate_hz):
    """Row 1."""
    initial, terminal, extra = [], [], 0
    for walk in captured_walks():
        found, _ = measure(walk if rate_hz == GAITMAP_HZ else walk.thinned(rate_hz))
        first, last = find_contacts(found)
        initial.append(match(first, walk.initial_s))
        terminal.append(match(last, walk.terminal_s))
        extra += count_extra(found, walk)
    for name, late in (("initial", initial), ("terminal", terminal)):
        late_s = np.concatenate(late)
        print(f"\n{rate_hz:5.1f} Hz {name:8}: {describe(late_s)}, {extra} extra", end="")
        assert abs(np.nanmean(late_s)) <= 0.010
        assert np.nanstd(late_s) <= 0.008
        assert np.isnan(late_s).sum() <= 1
    assert extra == 0


def test_any_mounting():
    """Row 1: 100 random mountings of both feet."""
    right, missed, extra, worst_s = 0, Counter[int](), 0, 0.0
    for walk in captured_walks(is_rotated=False):
        slow = walk.thinned(60)
        straight = measure(slow)[1].left
        for seed in range(100):
            matrix = random_mounting(seed)
            found, detector = measure(slow.turned(matrix))
            right += np.dot(matrix @ straight, detector.left) > 0.95
            late_s = match(find_contacts(found)[0], walk.initial_s)
            missed[int(np.isnan(late_s).sum())] += 1
            extra += count_extra(found, walk)
            worst_s = max(worst_s, abs(float(np.nanmean(late_s))))
    print(
        f"\n{right} of 200 signs right; missed {dict(missed)}, {extra} extra, bias ≤ {worst_s:.4f}"
    )
    assert right == 200
    assert max(missed) <= 1
    assert extra == 0
    assert worst_s <= 0.010


def split(walk: Walk) -> tuple[Floats, Floats]:
    """Return the initial and terminal contacts of straight walking, without a leg's first, last."""
    (begin_s, end_s), (turn_s, straight_s) = walk.facts["trial_s"], walk.facts["turn_s"]
    inside = (walk.terminal_s >= begin_s - 0.01) & (walk.initial_s <= end_s + 0.01)
    there = np.flatnonzero(inside & (walk.initial_s < turn_s))[1:-1]
    back = np.flatnonzero(inside & (walk.terminal_s > straight_s))[1:-1]
    chosen = np.concatenate((there, back))
    return walk.initial_s[chosen], walk.terminal_s[chosen]


def judge_turn(walk: Walk, strides: list[WearableStride]) -> Counter[str]:
    """Return how many strides within the U-turn are flagged, right and wrong."""
    turn_s, straight_s = walk.facts["turn_s"]
    told: Counter[str] = Counter()
    for one in strides:
        if one.end_s <= turn_s or one.initial_contact_s >= straight_s:
            continue
        ends = np.array([one.initial_contact_s, one.end_s])
        between = (walk.initial_s > ends[0] + 0.2) & (walk.initial_s < ends[1] - 0.2)
        is_right = not np.isnan(match(walk.initial_s, ends)).any() and not between.any()
        told["flagged" if one.reasons else "right" if is_right else "wrong"] += 1
    return told


@pytest.mark.parametrize("lost", [0.0, 0.1])
def test_straight_walks_turns_and_standing(lost):
    """Row 2; with a tenth of the samples lost besides those that are."""
    bias, spread, terminal, missed, known = [], [], [], 0, 0
    turns: Counter[str] = Counter()
    false = gaps = fewer = 0
    outside_s = 0.0
    stances: list[float] = []
    for number, walk in enumerate(turning_walks()):
        found, _ = measure(walk)
        if lost:
            whole = found
            kept = np.random.default_rng(number).random(len(walk.t_s)) >= lost
            thin = walk.picked(kept)
            gaps += int((np.diff(thin.t_s) > 0.1).sum())
            found, _ = measure(thin)
            fewer += max(0, len(whole) - len(found))
            stances += [
                abs(one.stance_s - other.stance_s)
                for one in found
                for other in whole
                if not one.reasons and abs(one.initial_contact_s - other.initial_contact_s) < 0.1
            ]
        initial, leaving = split(walk)
        first, last = find_contacts(found)
        late_s = match(first, initial)
        bias.append(np.nanmedian(late_s))
        spread.append(np.nanstd(late_s))
        terminal.append(np.nanmedian(match(last, leaving)))
        missed, known = missed + int(np.isnan(late_s).sum()), known + len(late_s)
        turns += judge_turn(walk, found)
        begin_s, end_s = walk.facts["trial_s"]
        outside_s += walk.t_s[-1] - walk.t_s[0] - (end_s - begin_s)
        alone = np.array(
            [one.end_s for one in found if not one.reasons
             and not begin_s - 0.5 <= one.end_s <= end_s + 0.5]
        )  # fmt: skip
        false += int((np.abs(alone[:, None] - walk.initial_s).min(axis=1, initial=9) > 0.3).sum())
    low, high = 1000 * min(bias), 1000 * max(bias)
    middle, leaves, width = (1000 * np.median(one) for one in (bias, terminal, spread))
    print(f"\n{lost:.0%} lost: initial {middle:.0f} ({low:.0f} … {high:.0f}), terminal "
          f"{leaves:.0f} ms; within a walk ± {width:.1f} ms; "
          f"{missed} of {known} missed; turns {dict(turns)}; "
          f"{false} false in {outside_s / 60:.1f} min outside")  # fmt: skip
    assert false <= 0.3 * outside_s / 60
    assert turns["wrong"] == 0
    if lost:
        wrong = sum(one > 0.06 for one in stances)
        print(f"{fewer} strides fewer by {gaps} gaps of 0.1 s; {wrong} of {len(stances)} stances "
              f"that count off by over 60 ms, at most {1000 * max(stances):.0f} ms")  # fmt: skip
        assert fewer <= gaps
        assert wrong <= 0.01 * len(stances)
    else:
        assert missed <= 0.02 * known
        assert np.median(spread) <= 0.012


def test_after_a_stroke():
    """Row 3: strides, signs, and foot against shank of the same leg."""
    walks, found = {}, {}
    signs = 0
    for walk in stroke_walks():
        walks[walk.name] = walk
        found[walk.name], detector = measure(walk)
        # Sensors of all legs sit alike: y to the right.
        signs += detector.left is not None and detector.left[1] < -0.5
    shares, ends, alone = {}, [], {}
    for name, strides in found.items():
        pair = [name.replace("right", "left"), name.replace("left", "right")]
        t_s, cycles = count_cycles(*(walks[one] for one in pair))
        steady = [one for one in strides if one.initial_contact_s >= STARTS_S]
        begin, end = np.interp([steady[0].initial_contact_s, steady[-1].end_s], t_s, cycles)
        shares[name] = len(steady) / (end - begin)
        ends += [begin - np.interp(STARTS_S, t_s, cycles), cycles[-1] - end]
        opposite, _ = find_contacts(found[next(one for one in pair if one != name)])
        between = [
            ((opposite > one.initial_contact_s) & (opposite < one.end_s)).sum() for one in strides
        ]
        alone[name] = between.count(1) / len(strides)
    low, high = min(shares.values()), max(shares.values())
    print(f"\n{signs} of {len(walks)} signs right; {low:.1%} … {high:.1%} of the strides found, at "
          f"most {max(ends):.1f} before and after them; {min(alone.values()):.1%} or more have one "
          "contact of the other leg, the belt's start included")  # fmt: skip
    for kind, name in enumerate(("initial", "terminal")):
        middles, spreads = [], []
        for leg in walks:
            if leg.endswith("foot"):
                own, others = (
                    find_contacts(found[one])[kind]
                    for one in (leg, leg.removesuffix("foot") + "shank")
                )
                late_s = match(others, own)
                middles.append(1000 * np.nanmedian(late_s))
                spreads.append(1000 * np.nanstd(late_s))
        early, late = min(middles), max(middles)
        print(f"{name}: shank {np.median(middles):.0f} ({early:.0f} … {late:.0f}) ms after the "
              f"foot, ± {np.median(spreads):.0f} ms within a walk")  # fmt: skip
        assert abs(np.median(middles)) <= 15
        assert np.median(spreads) <= 15
    assert 0.96 <= low <= high <= 1.02
    assert max(ends) <= 1.5  # a stride under way, and what it takes to know one
    assert min(alone.values()) >= 0.94
    assert signs == len(walks) == 72


def test_a_sensor_that_begins_in_the_middle_of_a_walk():
    """Row 3, as after a reload of the phone's page: until the sign is known."""
    waits, wrong, walks = [], 0, 0
    for walk in stroke_walks():
        for begin_s in range(20, 90, 15):
            detector = WearableDetector(walk.place)
            for first in range(100 * begin_s, 100 * begin_s + 3000, 50):
                cut = slice(first, first + 50)
                detector.feed(walk.t_s[cut], walk.rate[cut], walk.acceleration[cut])
                if detector.left is not None:
                    waits.append(first / 100 + 0.5 - begin_s)
                    wrong += detector.left[1] > -0.5
                    break
            walks += 1
    middle, most = np.percentile(waits, [50, 90])
    print(f"\nsign known after {middle:.1f} s (90 %: {most:.1f}, {walks - len(waits)} of {walks} "
          f"after 30 s), {wrong} wrong")  # fmt: skip
    assert wrong == 0
    assert walks - len(waits) <= 0.01 * walks
    assert most <= 10


def test_other_people_and_sensors():
    """Each leg again as a slower, weaker, noisier … one: as many strides as before."""
    known = {walk.name: len(measure(walk)[0]) for walk in stroke_walks()}
    for name, change in OTHERS.items():
        shares, wrong = {}, 0
        for walk in stroke_walks():
            found, detector = measure(change(walk))
            shares[walk.name] = len(found) / known[walk.name]
            # Sensors of all legs sit alike: y to the right.
            left = np.dot(random_mounting(7) if name == "turned" else np.eye(3), (0, -1, 0))
            wrong += detector.left is not None and float(np.dot(detector.left, left)) < 0
        outside = [leg for leg, share in shares.items() if not 0.96 <= share <= 1.02]
        low, high = min(shares.values()), max(shares.values())
        print(f"\n{name}: {low:.1%} … {high:.1%}, {wrong} signs wrong, outside {outside}", end="")
        assert wrong == 0
        assert len(outside) <= 2


def test_strides_are_known_soon():
    """From an initial contact until its stride is returned, at a phone's 60 Hz."""
    for place in ("foot", "shank"):
        waits: list[float] = []
        for walk in (one.thinned(60) for one in stroke_walks() if one.place == place):
            detector, own = WearableDetector(place), []
            for t_s, rate, acceleration in zip(
                walk.t_s.tolist(), walk.rate.tolist(), walk.acceleration.tolist(), strict=True
            ):
                found = detector.add(t_s, tuple(rate), tuple(acceleration))
                own += [t_s - one.end_s for one in found[-1:]]
            waits += own[1:]  # the first ones wait until the sign is known
        middle, most, longest = 1000 * np.percentile(waits, [50, 95, 100])
        print(f"\n{place}: {middle:.0f} ms, 95 %: {most:.0f}, at most {longest:.0f} ms", end="")
        assert longest <= 150


def read_pitches(foot: str) -> dict[int, list[float]]:
    """Return a foot's pitch [°] by motion capture at 100 Hz, of each stride."""
    with gzip.open(signals("gaitmap_imu") / "orientation_sample.csv.gz", "rt") as file:
        rows = list(csv.reader(file))[1:]
    pitches: dict[int, list[float]] = {}
    for sensor, stride, _, *parts in rows:
        if sensor.startswith(foot):
            x, y, z, w = map(float, parts)
            pitches.setdefault(int(stride), []).append(np.degrees(np.arcsin(-2 * (x * z + y * w))))
    return pitches


def test_foot_strike_angle():
    """Row 4: the angle at contact less that at the end of the stride, where the foot is flat."""
    with (signals("gaitmap_imu") / "stride_events_sample.csv").open() as file:
        events = list(csv.DictReader(file))
    off = []
    for walk in captured_walks():
        foot = walk.name.split()[1]
        found, pitches = measure(walk)[0], read_pitches(foot)
        for event in (one for one in events if one["foot"] == foot):
            begin, contact = float(event["start"]), float(event["ic"])
            pitch = pitches[int(event["s_id"])]
            true = pitch[round((contact - begin) / GAITMAP_HZ * 100)] - pitch[-1]
            own = [s for s in found if abs(s.initial_contact_s - contact / GAITMAP_HZ) < 0.1]
            off += [np.degrees(one.foot_strike_rad) - true for one in own if one.foot_strike_rad]
    limits = 1.96 * np.std(off, ddof=1)
    print(f"\nfoot strike: {np.mean(off):.1f}°, limits ± {limits:.1f}° of {len(off)} strides")
    assert abs(np.mean(off)) <= 2
    assert limits <= 5
    assert len(off) >= 50
