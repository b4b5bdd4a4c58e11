"""Strides by gyroscopes on feet or shanks: contacts, stride time and cadence, without an A2."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rehab.gait import GaitInputError, GyroscopeStride, GyroscopeStrideDetector
from rehab.gait.signals.clock import estimate_rate
from rehab.sources.intake.alignment import Floats
from rehab.sources.intake.settings import Gyroscope
from rehab.sources.reporting import Notify
from rehab.training.steps import Side

FIRST_SAMPLES = 100  # from which the rate is estimated
Sided = tuple[Side, GyroscopeStride]


class GyroscopePipeline:
    """Measures the strides of each gyroscope.

    Parameters
    ----------
    gyroscopes
        Those that are worn.
    rate_hz
        Samples per second; None to estimate it.
    notify
        Called with lines for the person who runs the source.
    """

    def __init__(
        self, gyroscopes: Sequence[Gyroscope], rate_hz: float | None, notify: Notify
    ) -> None:
        self._gyroscopes = {one.column.name: one for one in gyroscopes}
        self._rate_hz = rate_hz
        self._notify = notify
        self._held: dict[str, list[tuple[Floats, Floats]]] = {}
        self._detectors: dict[str, GyroscopeStrideDetector] = {}
        self._signs: dict[str, float] = {}

    @property
    def names(self) -> set[str]:
        """Names of the columns that hold rates."""
        return set(self._gyroscopes)

    def add(self, t_s: Floats, rates: Mapping[str, Floats]) -> list[Sided]:
        """Add samples of columns [s, as they come] and return the strides that they complete."""
        found: list[Sided] = []
        for name, values in rates.items():
            there = np.isfinite(values)
            gyroscope = self._gyroscopes[name]
            taken_s = t_s[there] - gyroscope.column.delay_s
            rate_rad_s = values[there] * gyroscope.column.factor
            detector = self._detectors.get(name)
            if detector is None:
                found += self._begin(name, taken_s, rate_rad_s)
            else:
                found += self._name(name, detector.feed(taken_s, rate_rad_s))
        return found

    def finish(self) -> list[Sided]:
        """Return the strides of samples that are still held back."""
        return [
            stride
            for name, detector in self._detectors.items()
            for stride in self._name(name, detector.finish())
        ]

    def _begin(self, name: str, t_s: Floats, rate_rad_s: Floats) -> list[Sided]:
        """Hold the first samples until their rate is known."""
        held = self._held.setdefault(name, [])
        held.append((t_s, rate_rad_s))
        times, rates = (np.concatenate(parts) for parts in zip(*held, strict=True))
        if len(times) < FIRST_SAMPLES:
            return []
        del self._held[name]
        segment = self._gyroscopes[name].segment
        try:
            rate_hz = self._rate_hz or estimate_rate(times)
            detector = GyroscopeStrideDetector(rate_hz, segment=segment)
        except GaitInputError as problem:
            self._notify(f"{problem} Times have to be the device's own, in seconds.")
            return []
        self._detectors[name] = detector
        return self._name(name, detector.feed(times, rates))

    def _name(self, name: str, strides: list[GyroscopeStride]) -> list[Sided]:
        """Return strides with their leg; report once how the rate is read."""
        side, sign = self._gyroscopes[name].side, self._detectors[name].sign
        if sign is not None and self._signs.get(name) != sign:
            self._signs[name] = sign
            turned = "as it comes" if sign > 0 else "with its sign turned"
            self._notify(f"The gyroscope {name} ({side} leg) is read {turned}.")
        return [(side, stride) for stride in strides]
