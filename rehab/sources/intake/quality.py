"""How well a source is received: rate, clock, lag and the last stride, in one line."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np

from rehab.gait.signals.clock import SampleClock
from rehab.gait.signals.frame_clock import FrameClock, read_frames
from rehab.gait.stances.gaps import GAP_S, LATE_SAMPLE_S
from rehab.sources.intake.alignment import Floats
from rehab.training.steps import Measurement

# The sender's clock against ours; quartz clocks differ by 100 millionths.
DRIFT_RATE, DRIFT_S = 0.0005, 0.02
JUDGED = 100  # samples are judged together, which costs as much as one does
CURES = {
    "late": "put back; close other programs on the lab's computer",
    "lost": "look at network and recorder",
    "drift": "let one clock stamp all channels",
}


class SignalQuality:
    """Counts what is received. Lag is a row's delay beyond the shortest one, by its own time."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self.late = self.lost = 0
        self.clock_jumps = 0
        self.bad_rows = 0
        self.frame_problem = ""  # why frame numbers are ignored, with the cure
        self._monotonic = monotonic
        self._since_s = monotonic()
        self._samples = 0
        self._last_s: dict[str, float] = {}  # of each stream, by its own clock
        self._clocks: dict[str, SampleClock | FrameClock] = {}
        self._waiting: dict[str, list[tuple[Floats, Floats | None]]] = {}  # not judged yet
        self._count = 0  # of samples that wait
        self._times_s: dict[str, float] = {}  # the newest one that the clock has released
        self._latest_s = self._longest_s = 0.0
        self._first: tuple[float, float] | None = None  # our time, and how far the sender is ahead
        self._newest: tuple[float, float] | None = None
        self._ahead_s = -math.inf
        self._lag_s = 0.0
        self._stride: Measurement | None = None
        self._stride_at_s = 0.0

    def count_samples(self, stream: str, t_s: Floats, frames: Floats | None = None) -> None:
        """Count samples of a stream, which may be numbered."""
        self._samples += len(t_s)
        first_s, newest_s = t_s.item(0), t_s.item(-1)
        went_back = first_s < self._last_s.get(stream, first_s)
        went_back = went_back or bool((t_s[1:] < t_s[:-1]).any())
        self.clock_jumps += went_back
        if stream not in self._clocks or (
            frames is not None and not isinstance(self._clocks[stream], FrameClock)
        ):
            self._judge(stream)
            self._clocks[stream] = SampleClock() if frames is None else FrameClock()
        waiting = self._waiting.setdefault(stream, [])
        waiting.append((t_s, frames))
        self._count += len(t_s)
        if self._count >= JUDGED:
            self._judge_all()
        self._last_s[stream] = newest_s
        self._update_lag(newest_s, went_back)

    def _judge_all(self) -> None:
        for stream in self._waiting:
            self._judge(stream)
        self._count = 0

    def _judge(self, stream: str) -> None:
        """Count what comes late and what is lost."""
        waiting = self._waiting.get(stream)
        if not waiting:
            return
        self._waiting[stream] = []
        t_s = np.concatenate([t_s for t_s, _ in waiting])
        clock = self._clocks[stream]
        usual_s = GAP_S
        if isinstance(clock, FrameClock):
            frames = np.concatenate([read_frames(frames, len(t_s)) for t_s, frames in waiting])
            (times,), late_s = clock.add(np.array([t_s]), 0, frames)
            self.frame_problem = self.frame_problem or clock.problem
            usual_s = GAP_S if clock.problem else clock.usual_s
        else:
            (times,), late_s = clock.add(np.array([t_s]))
        if not len(times):
            return
        if late_s is not None:
            self.late += int((late_s > LATE_SAMPLE_S).sum())
            self._latest_s = max(self._latest_s, float(late_s.max()))
        steps = np.diff(times, prepend=self._times_s.get(stream, times[0]))
        gaps = steps[steps > usual_s]
        if len(gaps):
            self.lost += len(gaps)
            self._longest_s = max(self._longest_s, float(gaps.max()))
        self._times_s[stream] = float(times[-1])

    def _describe_clock(self) -> str:
        """Return what is wrong with the sender's clock, with the cures."""
        found = []
        if self.late:
            found.append(f"{self.late} late by up to {1000 * self._latest_s:.0f} ms")
        if self.lost:
            found.append(f"{self.lost} times lost for up to {1000 * self._longest_s:.0f} ms")
        drift = self._find_drift()
        if drift:
            found.append(f"clocks drift by {1000 * drift:+.1f} ms a second")
        names = [n for n, is_so in zip(CURES, (self.late, self.lost, drift), strict=True) if is_so]
        return "".join(f"{text} ({CURES[name]}), " for text, name in zip(found, names, strict=True))

    def _find_drift(self) -> float:
        """Return by how much the sender's clock runs ahead of ours, 0 where they agree."""
        if self._first is None or self._newest is None:
            return 0.0
        passed_s = self._newest[0] - self._first[0]
        moved_s = self._newest[1] - self._first[1]
        if passed_s <= 0 or abs(moved_s) < DRIFT_S or abs(moved_s) < DRIFT_RATE * passed_s:
            return 0.0
        return moved_s / passed_s

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
        self._judge_all()
        now_s = self._monotonic()
        rate_hz = self._samples / max(now_s - self._since_s, 1e-9)
        rate = (
            f"{rate_hz:.0f} samples/s, {self._describe_clock()}" if self._last_s and rate_hz else ""
        )
        if not rate and self._last_s.keys() - {"strides"}:
            rate = f"no samples now, {self._describe_clock()}"
        lag = f"lag {1000 * self._lag_s:.0f} ms, "
        jumps = f"clock set back {self.clock_jumps}×, " if self.clock_jumps else ""
        bad = f"{self.bad_rows} rows not understood, " if self.bad_rows else ""
        self._since_s, self._samples, self._lag_s = now_s, 0, 0.0
        if math.isfinite(self._ahead_s):
            self._newest = now_s, self._ahead_s
            self._first = self._first or self._newest
            self._ahead_s = -math.inf
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
        if went_back:
            self._first = self._newest = None
        self._ahead_s = ahead_s if went_back else max(self._ahead_s, ahead_s)
        self._lag_s = max(self._lag_s, self._ahead_s - ahead_s)
