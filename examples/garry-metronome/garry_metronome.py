"""A source and a measure in a package of their own (docs/plugins.md)."""

import math
import random
from argparse import ArgumentParser, Namespace
from collections.abc import Callable

from rehab.sources.client import Display, NextStride
from rehab.sources.source import PlayedSource
from rehab.training.measures import Measure
from rehab.training.steps import Measurement, Side

BEAT_ERROR = Measure(
    slug="beat_error",
    name="distance from the beat",
    unit="%",
    value_min=0.0,
    value_max=50.0,
    goal_min=0.0,
    goal_max=50.0,
    higher_is_better=False,
    channel="beat_error_percent",  # where a stride has it
    first_goal=10.0,
)


class Metronome(PlayedSource):
    """Strides on a beat, more or less."""

    simulated = True  # nobody walks

    @classmethod
    def add_arguments(cls, parser: ArgumentParser) -> None:
        """Add the options of this source to a command line."""
        parser.add_argument("--beat", type=float, default=1.1, metavar="S", help="default: 1.1")
        parser.add_argument("--seed", type=int, default=0, help="the same seed walks the same")

    def __init__(self, options: Namespace, notify: Callable[[str], None]) -> None:
        """Read the command line. Raises ValueError, with the cure."""
        if not 0.5 <= options.beat <= 3:
            raise ValueError("A beat lies between 0.5 and 3 s. Give --beat 1.1.")
        self._beat_s, self._seed = options.beat, options.seed
        self._limit = options.strides or math.inf

    def open_walk(self, trained_side: Side) -> NextStride:
        """Return the strides of a walk, one a call."""
        chance, number = random.Random(self._seed), 0

        def walk(_shown: Display) -> Measurement | None:
            nonlocal number
            number += 1
            if number > self._limit:
                return None
            off = chance.uniform(-0.2, 0.2)
            extra = {"beat_error_percent": 100 * abs(off)}
            return Measurement(
                number, (number + off) * self._beat_s, trained_side, None, extra=extra
            )

        return walk
