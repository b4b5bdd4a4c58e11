"""Simulates a patient, who walks as the session's phases ask; with --signals from raw signals."""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rehab.sources.client import Display, NextStride
from rehab.sources.intake.treadmill_and_heart_rate import decode_treadmill, encode_treadmill
from rehab.sources.reporting import Notify
from rehab.sources.source import PlayedSource
from rehab.sources.synthetic.measured import express, show_goal
from rehab.sources.synthetic.profiles import PROFILES
from rehab.sources.synthetic.walker import SyntheticWalker
from rehab.training.measures import A2, MEASURES
from rehab.training.steps import HEART_RATE, Measurement, Side

if TYPE_CHECKING:
    from rehab.sources.synthetic.streaming import SignalWalker


# The simulated treadmill: slowly at first, then as fast as the patient learns to go.
REST_MIN, WALK_MIN, RISE_S = 72.0, 118.0, 90.0  # the simulated heart: at rest, walking [1/min]
FIRST_M_S, LAST_M_S, STEP_M_S, STEP_EVERY_S = 0.5, 0.9, 0.1, 60.0


def find_speed(time_s: float) -> float:
    """Return the speed [m/s] of the simulated treadmill's belt at a time [s]."""
    return min(LAST_M_S, FIRST_M_S + STEP_M_S * math.floor(max(0.0, time_s) / STEP_EVERY_S))


def find_heart_rate(time_s: float) -> float:
    """Return the heart rate [1/min] of the simulated patient at a time [s]."""
    return round(WALK_MIN - (WALK_MIN - REST_MIN) * math.exp(-max(0.0, time_s) / RISE_S))


class SyntheticSource(PlayedSource):
    """A simulated patient. Every stride depends on the phase that the one before may have ended."""

    max_unacknowledged = 1
    simulated = True

    @classmethod
    def add_arguments(cls, parser: ArgumentParser) -> None:
        """Add the options of this source to a command line."""
        parser.add_argument("--seed", type=int, default=0, help="the same seed walks the same")
        parser.add_argument(
            "--treadmill", action="store_true", help="a simulated treadmill says its speed, too"
        )
        parser.add_argument(
            "--heart-rate", action="store_true", help="a simulated heart-rate sensor, too"
        )
        parser.add_argument("--profile", choices=sorted(PROFILES), default="good")
        parser.add_argument(
            "--signals", action="store_true", help="measure the strides from simulated signals"
        )
        signals = parser.add_argument_group("raw signals")
        signals.add_argument("--mass", type=float, default=75.0, metavar="KG", help="default: 75")
        signals.add_argument("--rate", type=float, default=100.0, metavar="HZ", help="default: 100")
        signals.add_argument("--look-ahead", type=float, default=0.05, metavar="S")
        signals.add_argument(
            "--keep", type=Path, metavar="FILE", help="write the signals to a new file, here only"
        )

    def __init__(self, options: Namespace, notify: Notify) -> None:
        """Read the command line. Raises SourceError or GaitInputError."""
        self._profile = PROFILES[options.profile]
        self._seed: int = options.seed
        self._has_treadmill: bool = options.treadmill
        self._has_heart_rate: bool = options.heart_rate
        self._side = Side(options.side) if options.side else None
        self._open_signals = make_opener(options, notify) if options.signals else None
        self._notify = notify
        self._limit: float = math.inf if options.strides is None else options.strides

    def open_walk(self, trained_side: Side) -> NextStride:
        """Return the strides of a walk, one a call."""
        strider: SyntheticWalker | SignalWalker
        strider = walker = SyntheticWalker(self._profile, self._seed, self._side or trained_side)
        if self._open_signals is not None:
            strider = self._open_signals(walker)
        left, warned = self._limit, ""

        def walk(display: Display) -> Measurement | None:
            nonlocal left, warned
            left -= 1
            measure = MEASURES.get(display.measure, A2)
            if measure.channel and strider is not walker and warned != measure.slug:
                warned = measure.slug
                self._notify(
                    f"Simulated signals answer a goal of A2 alone, not of {measure.name}. Start "
                    "this source without --signals: then the patient walks every measure."
                )
            show_goal(walker, display.goal, measure)
            walker.valence = display.valence
            if left < 0:
                return None
            stride = strider.next_stride(display.phase)
            stride = express(stride, walker, measure) if strider is walker else stride
            if self._has_treadmill:
                said = decode_treadmill(encode_treadmill(find_speed(stride.time_s)))
                stride = replace(stride, extra=dict(stride.extra) | said)
            if self._has_heart_rate:
                said = {HEART_RATE: find_heart_rate(stride.time_s)}
                stride = replace(stride, extra=dict(stride.extra) | said)
            return stride

        return walk


def make_opener(options: Namespace, notify: Notify) -> Callable[[SyntheticWalker], SignalWalker]:
    """Return a function that adds signals to a walker. Raises SourceError or GaitInputError."""
    from rehab.gait import TwoLegDetector
    from rehab.sources.intake import IntakeSettings
    from rehab.sources.intake.recorder import SignalRecorder
    from rehab.sources.synthetic.signals import Sensors
    from rehab.sources.synthetic.streaming import SignalMaker, SignalWalker

    settings = IntakeSettings.read(options)
    mass_kg, rate_hz, look_ahead_s = options.mass, options.rate, settings.look_ahead_s

    def make_detector() -> TwoLegDetector:
        return TwoLegDetector(rate_hz, mass_kg, look_ahead_s=look_ahead_s)

    make_detector()
    keep = SignalRecorder(settings.keep, notify).write if settings.keep else None
    sensors = Sensors(rate_hz=rate_hz)

    def open_signals(walker: SyntheticWalker) -> SignalWalker:
        maker = SignalMaker(mass_kg, sensors, options.seed, walker.side)
        detector = make_detector()
        return SignalWalker(walker, maker, detector, *([keep] if keep else []))

    return open_signals
