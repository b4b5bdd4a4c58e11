"""Recordings of synthetic strides, with what they were made from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rehab.sources.synthetic.signals import (
    A2_DEFAULT_W_KG,
    Floats,
    LegBuilder,
    LegSignals,
    Sensors,
    add_sensors,
    find_stance_s,
)
from rehab.training.steps import Measurement


@dataclass(frozen=True, slots=True)
class TrueStride:
    """What a synthetic stride was made with. ``is_bad``: its force was cut off in stance."""

    side: str
    initial_contact_s: float
    terminal_contact_s: float
    a2_w_kg: float | None
    is_bad: bool = False


@dataclass(frozen=True, slots=True)
class SyntheticRecording:
    """Signals of a walk and the strides that they were made from, in order of time."""

    t_s: Floats
    left: LegSignals
    right: LegSignals
    rate_hz: float
    mass_kg: float
    strides: tuple[TrueStride, ...]


def make_signals(
    strides: Sequence[Measurement],
    mass_kg: float = 75.0,
    sensors: Sensors | None = None,
    seed: int = 0,
    other_a2_w_kg: float = A2_DEFAULT_W_KG,
    longest_s: float = 3.0,
) -> SyntheticRecording:
    """Return the signals of a walk whose strides of one leg are given, as ``walk`` yields them.

    A stride lasts until the next one's time; where that is no stride time (pauses between trials),
    it lasts 1.1 s: a time beyond ``longest_s`` is a pause. The other leg steps half a stride later.
    A stride with reasons loses its force in mid-stance, one without a value its moment.
    """
    sensors = sensors or Sensors()
    rng = np.random.default_rng(seed)
    lengths = [b.time_s - a.time_s for a, b in pairwise(strides)]
    lengths = [*lengths, lengths[-1] if lengths else 1.1]
    lengths = [length if 0.5 <= length <= longest_s else 1.1 for length in lengths]
    total_s = sum(lengths) + 2.0
    count = int(total_s * sensors.rate_hz)
    t_s = np.arange(count) / sensors.rate_hz
    jitter = rng.normal(0, sensors.jitter_s, count)
    t_s = t_s + np.clip(jitter, -0.4 / sensors.rate_hz, 0.4 / sensors.rate_hz)
    trained = strides[0].side.value
    other = "right" if trained == "left" else "left"
    legs = {side: LegBuilder(t_s, mass_kg) for side in (trained, other)}
    truth: list[TrueStride] = []

    def step(side: str, begin_s: float, stride_s: float, a2: float, of: Measurement | None) -> None:
        legs[side].walk(begin_s, stride_s, a2, of, sensors.angle_delay_s)
        known = None if of is not None and of.value is None else a2
        is_bad = of is not None and bool(of.reasons)
        end_s = begin_s + find_stance_s(stride_s)
        truth.append(TrueStride(side, begin_s, end_s, known, is_bad))

    begin_s = 1.0
    step(other, begin_s - lengths[0] / 2, lengths[0], other_a2_w_kg, None)
    for stride, length, following in zip(
        strides, lengths, [*lengths[1:], lengths[-1]], strict=True
    ):
        value = A2_DEFAULT_W_KG if stride.value is None else stride.value
        step(trained, begin_s, length, value, stride)
        step(other, begin_s + length / 2, (length + following) / 2, other_a2_w_kg, None)
        begin_s += length
    signals = {side: add_sensors(leg, sensors, rng) for side, leg in legs.items()}
    truth.sort(key=lambda stride: stride.terminal_contact_s)
    return SyntheticRecording(
        t_s, signals["left"], signals["right"], sensors.rate_hz, mass_kg, tuple(truth)
    )
