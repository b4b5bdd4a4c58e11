"""How well a source is received: rate, gaps, lag and the last stride, in one line."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np

from rehab.sources.intake.alignment import Floats
from rehab.training.steps import Measurement

GAP_S = 0.05  # a longer one makes its stride invalid (docs/reference/gait.md#time-base)


class SignalQuality:
    """Counts what is received. Lag is a row's delay beyond the shortest one, by its own time."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self.gaps = 0
        self.clock_jumps = 0
        self.bad_rows = 0
        self._monotonic = monotonic
        self._since_s = monotonic()
        self._samples = 0
        self._last_s: dict[str, float] = {}  # of each stream, by its own clock
        self._ahead_s = -math.inf
        self._lag_s = 0.0
        self._stride: Measurement | None = None
        self._stride_at_s = 0.0

    def count_samples(self, stream: str, t_s: Floats) -> None:
        """Count samples of a stream."""
        self._samples += len(t_s)
        last_s = self._last_s.get(stream)
        steps = np.diff(t_s if last_s is None else np.concatenate(([last_s], t_s)))
        self.gaps += int((steps > GAP_S).sum())
        went_back = bool((steps < 0).any())
        self.clock_jumps += went_back
        self._last_s[stream] = float(t_s[-1])
        self._update_lag(float(t_s[-1]), went_back)

    def record_stride(self, stride: Measurement, *, is_timed: bool) -> None:
        """Store a stride; one that came with its device's time also updates the lag."""
        self._stride, self._stride_at_s = stride, self._monotonic()
        if is_timed:
            last_s = self._last_s.get("strides")
            went_back = last_s is not None and stride.time_s < last_s
            self.clock_jumps += went_back
            self._last_s["strides"] = stride.time_s
            self._update_lag(stride.time_s, went_back)

    def describe(self) -> str:
        """Return the line, and reset the counts."""
        now_s = self._monotonic()
        rate_hz = self._samples / max(now_s - self._since_s, 1e-9)
        rate = f"{rate_hz:.0f} samples/s, {self.gaps} gaps, " if self._last_s and rate_hz else ""
        if not rate and self._last_s.keys() - {"strides"}:
            rate = f"no samples now, {self.gaps} gaps, "
        lag = f"lag {1000 * self._lag_s:.0f} ms, "
        jumps = f"clock set back {self.clock_jumps}×, " if self.clock_jumps else ""
        bad = f"{self.bad_rows} rows not understood, " if self.bad_rows else ""
        self._since_s, self._samples, self._lag_s = now_s, 0, 0.0
        return f"{rate}{lag}{jumps}{bad}{self._describe_stride(now_s)}"

    def _describe_stride(self, now_s: float) -> str:
        stride = self._stride
        if stride is None:
            return "no stride yet"
        value = "no value" if stride.value is None else f"{stride.value:.2f}"
        doubts = f" ({', '.join(stride.reasons)})" if stride.reasons else ""
        ago_s = now_s - self._stride_at_s
        return f"last stride {stride.side} {value}{doubts}, {ago_s:.1f} s ago"

    def _update_lag(self, time_s: float, went_back: bool) -> None:
        ahead_s = time_s - self._monotonic()
        self._ahead_s = ahead_s if went_back else max(self._ahead_s, ahead_s)
        self._lag_s = max(self._lag_s, self._ahead_s - ahead_s)
