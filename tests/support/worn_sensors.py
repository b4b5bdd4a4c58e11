"""Real recordings of worn sensors, and strides measured from them."""

from __future__ import annotations

import csv
import gzip
import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, hilbert, sosfiltfilt

from rehab.gait import WearableDetector, WearableStride
from tests.support.data import signals

Floats = NDArray[np.float64]


@dataclass
class Walk:
    """One sensor's samples: times [s], rates [rad/s] and accelerations [m/s²], shape (n, 3).

    ``initial_s`` and ``terminal_s`` are its contacts where a reference knows them; ``facts`` what
    else it says.
    """

    name: str
    place: str
    t_s: Floats
    rate: Floats
    acceleration: Floats
    initial_s: Floats = field(default_factory=lambda: np.empty(0))
    terminal_s: Floats = field(default_factory=lambda: np.empty(0))
    facts: dict[str, Any] = field(default_factory=dict)

    def thinned(self, rate_hz: float) -> Walk:
        """Return the walk as a sensor of another rate would have it, by linear interpolation."""
        t_s = np.arange(self.t_s[0], self.t_s[-1], 1 / rate_hz)
        rate, acceleration = (
            np.stack([np.interp(t_s, self.t_s, one) for one in table.T], 1)
            for table in (self.rate, self.acceleration)
        )
        return self.changed(t_s, rate, acceleration)

    def turned(self, matrix: Floats) -> Walk:
        """Return the walk of a sensor that is mounted turned."""
        return self.changed(self.t_s, self.rate @ matrix.T, self.acceleration @ matrix.T)

    def picked(self, chosen: NDArray[Any] | slice) -> Walk:
        """Return the walk with only some of its samples."""
        return self.changed(self.t_s[chosen], self.rate[chosen], self.acceleration[chosen])

    def changed(self, t_s: Floats, rate: Floats, acceleration: Floats) -> Walk:
        """Return the walk with other samples."""
        return Walk(
            self.name,
            self.place,
            t_s,
            rate,
            acceleration,
            self.initial_s,
            self.terminal_s,
            self.facts,
        )


def measure(walk: Walk) -> tuple[list[WearableStride], WearableDetector]:
    """Return the strides of a walk, and their detector."""
    detector = WearableDetector(walk.place)
    return detector.feed(walk.t_s, walk.rate, walk.acceleration), detector


def stroke_walks(*names: str) -> Iterator[Walk]:
    """Return the walks of people after a stroke whose names begin with one of these; else all."""
    for path in sorted(signals("stroke_imu").glob("*.csv.gz")):
        name = path.name.removesuffix(".csv.gz")
        if names and not name.startswith(names):
            continue
        with gzip.open(path) as file:
            table = np.loadtxt(file, delimiter=",", skiprows=1)
        count = np.unwrap(table[:, 0], period=65536)
        place = "foot" if name.endswith("foot") else "shank"
        yield Walk(name, place, (count - count[0]) / 100, table[:, 4:7], table[:, 1:4])


def turning_walks(*names: str) -> Iterator[Walk]:
    """Return walks of healthy people, 10 m there and back, of both feet; the counter is kept."""
    for path in sorted(signals("healthy_imu_turns").glob("*.json")):
        if names and not path.stem.startswith(names):
            continue
        facts = json.loads(path.read_text())
        for letter, side in (("l", "Left"), ("r", "Right")):
            with gzip.open(path.with_name(f"{path.stem}_{letter}f.txt.gz")) as file:
                table = np.loadtxt(file, skiprows=2)
            events = np.array(facts[f"{side}FootEvents"]) / 100
            known = {
                "trial_s": [at / 100 for at in facts["TrialBoundaries"]],
                "turn_s": [at / 100 for at in facts["UTurnBoundaries"]],
            }
            t_s = table[:, 0] / 100
            yield Walk(f"{path.stem} {side.lower()}", "foot", t_s, table[:, 4:7], table[:, 1:4],
                       events[:, 1], events[:, 0], known)  # fmt: skip


GAITMAP_HZ = 204.8
# After a stroke: in which the belt begins to move. Until then there is no main frequency [s].
STARTS_S = 20


def captured_walks(*, is_rotated: bool = True) -> Iterator[Walk]:
    """Return the walk of one healthy person's feet, with contacts by motion capture."""
    folder = signals("gaitmap_imu")
    packed = folder / "imu_sample_not_rotated.csv.gz"
    text = (
        (folder / "imu_sample.csv").read_text()
        if is_rotated
        else gzip.decompress(packed.read_bytes()).decode()
    )
    lines = text.splitlines()
    sensors, axes = csv.reader(lines[:2])
    table = np.loadtxt(lines[2:], delimiter=",")
    names = list(zip(sensors, axes, strict=True))
    with (folder / "stride_events_sample.csv").open() as file:
        events = list(csv.DictReader(file))
    for foot in ("left", "right"):

        def pick(kind: str, foot: str = foot) -> Floats:
            return table[:, [names.index((f"{foot}_sensor", f"{kind}_{axis}")) for axis in "xyz"]]

        own = [event for event in events if event["foot"] == foot]
        t_s = np.arange(len(table)) / GAITMAP_HZ
        initial = np.array(sorted({float(e["ic"]) for e in own})) / GAITMAP_HZ
        terminal = np.array([float(e["tc"]) for e in own]) / GAITMAP_HZ
        strides = [(int(float(e["start"])), int(float(e["end"]))) for e in own]
        yield Walk(f"gaitmap {foot}", "foot", t_s, np.radians(pick("gyr")), pick("acc"), initial,
                   terminal, {"strides": strides})  # fmt: skip


def find_contacts(strides: list[WearableStride]) -> tuple[Floats, Floats]:
    """Return all initial contacts of strides, also those that end one, and terminal contacts."""
    initial = {round(at, 6) for one in strides for at in (one.initial_contact_s, one.end_s)}
    return np.array(sorted(initial)), np.array([one.terminal_contact_s for one in strides])


def match(found: Floats, true: Floats, within_s: float = 0.15) -> Floats:
    """Return by how much each true contact is found late [s]; NaN for one that is missed."""
    if not len(found) or not len(true):
        return np.full(len(true), np.nan)
    apart = found[np.newaxis] - true[:, np.newaxis]
    nearest = apart[np.arange(len(true)), np.abs(apart).argmin(axis=1)]
    return np.where(np.abs(nearest) <= within_s, nearest, np.nan)


def count_cycles(left: Walk, right: Walk) -> tuple[Floats, Floats]:
    """Return times [s] and how many strides were walked until then, without any detector.

    By the phase of the left leg's rate less the right one's, both about the axis from left to
    right: they swing in turn, so that a stride is one cycle of it, whatever each leg's shape. The
    band, 0.5 to 1.5 times the trial's main frequency, leaves out its halves and multiples.
    """
    t_s = np.arange(0, min(left.t_s[-1], right.t_s[-1]), 0.01)
    one, other = (np.interp(t_s, walk.t_s, walk.rate[:, 1]) for walk in (left, right))
    power = np.abs(np.fft.rfft(one - other, 2**16))
    hz = np.fft.rfftfreq(2**16, 0.01)
    main_hz = hz[np.where((hz > 0.2) & (hz < 2), power, 0).argmax()]
    band = butter(2, (0.5 * main_hz, 1.5 * main_hz), "bandpass", fs=100, output="sos")
    return t_s, np.unwrap(np.angle(hilbert(sosfiltfilt(band, one - other)))) / (2 * np.pi)
