"""From samples to strides: detects rate and legs, then feeds the detectors of ``rehab.gait``."""

from __future__ import annotations

from typing import Any

import numpy as np

from rehab.gait import (
    Finding,
    GaitInputError,
    LegSamples,
    Stride,
    StrideDetector,
    TwoLegDetector,
    check_signals,
    make_detector,
)
from rehab.gait.recordings.column_mapping import CHANNELS, REQUIRED, SIDES
from rehab.gait.settings import check_rate
from rehab.gait.signals.clock import estimate_rate
from rehab.sources.intake.alignment import FRAME, Channel, Floats, Samples
from rehab.sources.reporting import Notify

FIRST_SAMPLES = 100  # from which legs and rate are detected
CHECK_S = 30.0
LEGS: dict[str, list[Channel]] = {side: [(side, name) for name in CHANNELS] for side in SIDES}


class SignalPipeline:
    """Measures the strides of one or both legs of a walker.

    Parameters
    ----------
    mass_kg
        Body mass of the walker [kg].
    rate_hz
        Samples per second; None to estimate it.
    look_ahead_s, is_overground
        As in ``rehab.gait.StrideDetector``.
    notify
        Called with lines for the person who runs the source.
    """

    def __init__(
        self,
        mass_kg: float,
        rate_hz: float | None,
        look_ahead_s: float,
        notify: Notify,
        *,
        is_overground: bool = False,
    ) -> None:
        self.mass_kg = mass_kg
        self.rate_hz = rate_hz
        self._how: dict[str, Any] = {
            "look_ahead_s": look_ahead_s,
            "is_overground": is_overground,
        }
        self._notify = notify
        self._held: list[Samples] = []
        self._detector: TwoLegDetector | StrideDetector | None = None
        self._sides: tuple[str, ...] = ()
        self._others: set[str] = set()  # sides that came too late
        self._fed: set[Channel] = set()  # of the newest samples
        self._checked: list[Samples] | None = []

    def add(self, t_s: Floats, values: dict[Channel, Floats]) -> list[Stride]:
        """Add samples and return the strides that they complete."""
        if not len(t_s):
            return []
        self._keep_for_check(t_s, values)
        if self._detector is not None:
            return self._feed(t_s, values)
        self._held.append((t_s, values))
        return self._begin() if sum(len(t) for t, _ in self._held) >= FIRST_SAMPLES else []

    def finish(self) -> list[Stride]:
        """Return the strides that still wait, once no more samples come."""
        strides = self._begin() if self._held else []
        return strides + (self._detector.finish() if self._detector is not None else [])

    def check(self) -> tuple[Finding, ...]:
        """Return the findings of the self-check of the first half minute, once; else nothing."""
        held = self._checked
        if not held or self.rate_hz is None or held[-1][0][-1] - held[0][0][0] < CHECK_S:
            return ()
        self._checked = None
        t_s = np.concatenate([t for t, _ in held])
        whole = {
            channel: np.concatenate([_values(values, channel, len(t)) for t, values in held])
            for channel in {channel for _, values in held for channel in values}
        }
        legs = [_leg(whole, side, t_s) if side in self._sides else None for side in SIDES]
        return check_signals(
            t_s,
            legs[0],
            legs[1],
            rate_hz=self.rate_hz,
            mass_kg=self.mass_kg,
            is_overground=bool(self._how["is_overground"]),
        ).findings

    def _keep_for_check(self, t_s: Floats, values: dict[Channel, Floats]) -> None:
        if self._checked is None:
            return
        if self._checked and not t_s[0] > self._checked[-1][0][-1]:
            self._checked = []  # the clock went back: what follows is another half minute
        self._checked.append((t_s, values))

    def _begin(self) -> list[Stride]:
        """Set up the detectors for the samples that were held, and feed these to them."""
        held, self._held = self._held, []
        channels = {channel for _, values in held for channel in values} - {FRAME}
        sides = tuple(s for s in SIDES if all((s, name) in channels for name in REQUIRED))
        if not sides:
            missing = sorted({f"{s}.{n}" for s, _ in channels for n in REQUIRED} - {
                ".".join(channel) for channel in channels
            })  # fmt: skip
            self._notify(
                f"No leg can be measured without {', '.join(missing)}. Send it, or map it."
            )
            return []
        try:
            rate_hz = self.rate_hz or estimate_rate(
                np.concatenate([t for t, _ in held])[:FIRST_SAMPLES]
            )
            check_rate(rate_hz)
            self._sides, self.rate_hz = sides, rate_hz
            self._detector = make_detector(sides, rate_hz, self.mass_kg, **self._how)
        except GaitInputError as problem:
            self._notify(f"{problem} Times have to be the device's own, in seconds.")
            return []
        legs = " and ".join(sides)
        self._notify(f"Signals of the {legs} leg come at {self.rate_hz:.0f} Hz.")
        return [stride for t, values in held for stride in self._feed(t, values)]

    def _feed(self, t_s: Floats, values: dict[Channel, Floats]) -> list[Stride]:
        if values.keys() != self._fed:
            self._fed = set(values)
            self._report_late_legs()
        frames = values.get(FRAME)
        assert self._detector is not None  # noqa: S101 (set by _begin)
        legs = {side: _leg(values, side, t_s) for side in self._sides}
        return self._detector.feed_legs(t_s, legs, frame=frames)

    def _report_late_legs(self) -> None:
        late = {side for side, _ in self._fed - {FRAME}} - set(self._sides) - self._others
        if late:
            self._others |= late
            self._notify(
                f"Signals of the {' and '.join(sorted(late))} leg came too late to be measured. "
                "Start this source again while both legs send."
            )


def _values(values: dict[Channel, Floats], channel: Channel, count: int) -> Floats:
    found = values.get(channel)
    return np.full(count, np.nan) if found is None else found


def _leg(values: dict[Channel, Floats], side: str, t_s: Floats) -> LegSamples:
    """Return a leg's channels; NaN for a required one that these samples lack."""
    force, moment, angle, *further = [values.get(key) for key in LEGS[side]]
    if force is None or moment is None or angle is None:
        force, moment, angle = [_values(values, key, len(t_s)) for key in LEGS[side][:3]]
    return LegSamples(force, moment, angle, *further)
