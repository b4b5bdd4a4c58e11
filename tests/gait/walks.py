"""Walks whose strides are known: one recorded, the others synthetic."""

import csv
import json
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, filtfilt

from rehab.gait import LegSamples, TwoLegDetector, check_signals, measure_strides
from rehab.sources.synthetic.signals import Sensors
from rehab.training.steps import Measurement, Side
from tests.support.data import signals
from tests.support.synthetic_recordings import make_signals

FORCE, MOMENT, ANGLE = range(3)


@dataclass(frozen=True)
class Walk:
    """Signals of both legs, shape (3, n): force, moment, angle."""

    t_s: np.ndarray
    left: np.ndarray
    right: np.ndarray
    rate_hz: float
    mass_kg: float
    frames: np.ndarray | None = None

    def one_leg(self, **settings):
        return self._measure({"left": LegSamples(*self.left)}, **settings)

    def both_legs(self, **settings):
        legs = {"left": LegSamples(*self.left), "right": LegSamples(*self.right)}
        return self._measure(legs, frame=self.frames, **settings)

    def _measure(self, legs, **settings):
        given = {"rate_hz": self.rate_hz, "mass_kg": self.mass_kg} | settings
        return measure_strides(self.t_s, legs, **given)

    def check(self, strides=None):
        """Return the self-check of the whole walk."""
        given = {"rate_hz": self.rate_hz, "mass_kg": self.mass_kg, "strides": strides}
        return check_signals(self.t_s, [*self.left], [*self.right], **given)

    def chunks(self, size):
        """Yield times and both legs in chunks, as ``TwoLegDetector.feed`` takes them."""
        for first in range(0, len(self.t_s), size):
            part = slice(first, first + size)
            legs = (LegSamples(*leg[:, part]) for leg in (self.left, self.right))
            yield self.t_s[part], *legs

    def in_chunks(self, size, **settings):
        """Return the strides of both legs, fed chunk by chunk."""
        detector = TwoLegDetector(self.rate_hz, self.mass_kg, **settings)
        strides = [stride for chunk in self.chunks(size) for stride in detector.feed(*chunk)]
        return strides + detector.finish()

    def change(self, row, change, *, both=False):
        """Return the walk with one channel changed, on the left or on both legs."""
        legs = [self.left.copy(), self.right.copy()]
        for leg in legs[: 2 if both else 1]:
            leg[row] = change(leg[row])
        return replace(self, left=legs[0], right=legs[1])


def read_moore_columns() -> dict[str, np.ndarray]:
    """Return the columns of the recorded walk by name."""
    with (signals("moore2013_s15_pre") / "UnpertPre_data.csv").open() as file:
        names = next(csv.reader(file))
        return dict(zip(names, np.loadtxt(file, delimiter=",", unpack=True), strict=True))


def read_moore() -> tuple[Walk, dict[str, list[dict[str, float]]]]:
    """Return the recorded walk and its reference strides by side."""
    column = read_moore_columns()
    legs = [
        np.array(
            [
                column[f"{side}GRF_y"],
                column[f"{side}AnklePlantarFlexionMoment"],
                column[f"{side}AnklePlantarFlexionAngle"],
            ]
        )
        for side in ("Left", "Right")
    ]
    path = signals("moore2013_s15_pre") / "reference.json"
    reference = json.loads(path.read_text())["legs"]
    strides = {side.lower(): reference[side]["strides"] for side in reference}
    return Walk(column["time"], legs[0], legs[1], rate_hz=100, mass_kg=79.4), strides


def make_walk(
    *, stride_s=1.1, a2_w_kg=2.5, mass_kg=75.0, strides=30, seed=0, other_a2_w_kg=None, **sensors
):
    """Return a synthetic walk and its true strides of the left leg."""
    rng = np.random.default_rng(seed)
    times = np.cumsum(stride_s * (1 + 0.02 * rng.normal(size=strides)))
    values = a2_w_kg * (1 + 0.1 * rng.normal(size=strides))
    given = [
        Measurement(number=i + 1, time_s=float(times[i]), side=Side.LEFT, value=float(values[i]))
        for i in range(strides)
    ]
    recording = make_signals(
        given,
        mass_kg,
        Sensors(**sensors),
        seed,
        a2_w_kg if other_a2_w_kg is None else other_a2_w_kg,
        longest_s=2 * stride_s,
    )
    legs = [
        np.array([leg.force_n, leg.moment_nm, leg.angle_rad])
        for leg in (recording.left, recording.right)
    ]
    truth = [stride for stride in recording.strides if stride.side == "left"]
    return Walk(recording.t_s, legs[0], legs[1], recording.rate_hz, recording.mass_kg), truth


CLEAN = {
    "rate_hz": 1000,
    "jitter_s": 0.0,
    "force_noise_n": 0.0,
    "moment_noise_nm": 0.0,
    "angle_noise_rad": 0.0,
}


def filter_offline(walk: Walk, truth) -> list[float]:
    """Return A2 by the method of the references: all signals filtered at 6 Hz, forward-backward.

    Written with scipy's own filter and numpy's own gradient, and no code of ``rehab.gait``.
    """
    rate = walk.rate_hz
    b, a = butter(2, 6 / (rate / 2))
    moment = filtfilt(b, a, walk.left[MOMENT] / walk.mass_kg)
    power = moment * np.gradient(filtfilt(b, a, walk.left[ANGLE]), 1 / rate)
    peaks = []
    for stride in truth:
        begin, end = stride.initial_contact_s, stride.terminal_contact_s
        first, last = np.searchsorted(walk.t_s, (begin + 0.4 * (end - begin), end))
        peaks.append(float(power[first:last].max()))
    return peaks


def pair_up(found, times):
    """Return for each true initial contact the stride found within 150 ms, or None."""
    contacts = np.array([stride.initial_contact_s for stride in found])
    pairs = []
    for time in times:
        nearest = int(np.abs(contacts - time).argmin()) if len(contacts) else -1
        near = nearest >= 0 and abs(contacts[nearest] - time) < 0.15
        pairs.append(found[nearest] if near else None)
    return pairs
