"""A synthetic walker's signals stride by stride, and the strides that are measured from them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import numpy as np

from rehab.gait import LegSamples, TwoLegDetector
from rehab.sources.intake.alignment import Channel, Floats
from rehab.sources.intake.measurements import to_measurement
from rehab.sources.synthetic.signals import (
    A2_DEFAULT_W_KG,
    LegBuilder,
    LegSignals,
    Sensors,
    add_sensors,
)
from rehab.sources.synthetic.walker import SyntheticWalker
from rehab.training.phases import Phase
from rehab.training.steps import Measurement, Side

BEGIN_S = 1.0  # of standing beside the belt
STRIDE_S = 1.1  # for one that has no time, as after a pause


class SignalMaker:
    """Makes signals of both legs that end with the newest stride, in constant memory.

    The other leg steps half a stride later.
    """

    def __init__(self, mass_kg: float, sensors: Sensors, seed: int, side: Side) -> None:
        self._mass_kg = mass_kg
        self._sensors = sensors
        self._random = np.random.default_rng(seed)
        self._side = side
        self._other = Side.RIGHT if side == Side.LEFT else Side.LEFT
        self._index = 0
        self._before = (BEGIN_S - STRIDE_S, STRIDE_S)  # when the last stride began, its time
        self._begin_s = BEGIN_S

    def walk(self, stride: Measurement, stride_s: float) -> tuple[Floats, dict[Side, LegSignals]]:
        """Return the samples up to this stride's end: their times, and the legs' signals."""
        sensors, begin_s = self._sensors, self._begin_s
        stop = math.ceil((begin_s + stride_s) * sensors.rate_hz)
        t_s = np.arange(self._index, stop) / sensors.rate_hz
        most_s = 0.4 / sensors.rate_hz
        t_s += np.clip(self._random.normal(0, sensors.jitter_s, len(t_s)), -most_s, most_s)
        legs = {side: LegBuilder(t_s, self._mass_kg) for side in (self._side, self._other)}
        delay_s = sensors.angle_delay_s
        value = A2_DEFAULT_W_KG if stride.value is None else stride.value
        legs[self._side].walk(begin_s, stride_s, value, stride, delay_s)
        before_s, pace_s = self._before
        legs[self._other].walk(
            before_s + pace_s / 2, (pace_s + stride_s) / 2, A2_DEFAULT_W_KG, None, delay_s, pace_s
        )
        legs[self._other].walk(begin_s + stride_s / 2, stride_s, A2_DEFAULT_W_KG, None, delay_s)
        self._index, self._before = stop, (begin_s, stride_s)
        self._begin_s += stride_s
        return t_s, {side: add_sensors(leg, sensors, self._random) for side, leg in legs.items()}


class SignalWalker:
    """A synthetic walker whose strides are measured from signals, as those of a real one are.

    Parameters
    ----------
    walker
        Who walks.
    maker
        Makes the signals.
    detector
        Measures them.
    keep
        Called with all samples.
    """

    def __init__(
        self,
        walker: SyntheticWalker,
        maker: SignalMaker,
        detector: TwoLegDetector,
        keep: Callable[[Floats, dict[Channel, Floats]], None] = lambda _t_s, _values: None,
    ) -> None:
        self._walker, self._maker, self._detector, self._keep = walker, maker, detector, keep
        self._last_s: float | None = None
        self._ready: deque[Measurement] = deque()
        self._number = 0

    def next_stride(self, phase: Phase) -> Measurement:
        """Walk in this phase until the next stride of either leg is measured, and return it."""
        while not self._ready:
            self._walk(phase)
        return self._ready.popleft()

    def _walk(self, phase: Phase) -> None:
        stride = self._walker.next_stride(phase)
        stride_s = stride.time_s - (0.0 if self._last_s is None else self._last_s)
        self._last_s = stride.time_s
        t_s, legs = self._maker.walk(stride, stride_s if 0.5 <= stride_s <= 3.0 else STRIDE_S)
        self._keep(
            t_s,
            {
                (str(side), name): values
                for side, leg in legs.items()
                for name, values in zip(
                    ("force", "moment", "angle", "forward"), _channels(leg), strict=True
                )
            },
        )
        found = self._detector.feed(t_s, *(LegSamples(*_channels(legs[s])) for s in Side))
        for measured in found:
            named = to_measurement(measured, self._number + 1, stride.side)
            if named is not None:
                self._number += 1
                self._ready.append(named)


def _channels(leg: LegSignals) -> tuple[Floats, Floats, Floats, Floats]:
    return leg.force_n, leg.moment_nm, leg.angle_rad, leg.forward_n
