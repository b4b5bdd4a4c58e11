"""What a source is: something made from a command line that has strides to give."""

from __future__ import annotations

from abc import ABC, abstractmethod
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from typing import TYPE_CHECKING

from rehab.sources.client import Walk
from rehab.training.steps import Side
from robot.wire.limits import MAX_STEPS

if TYPE_CHECKING:
    from rehab.sources.intake import Intake, IntakeSettings

Say = Callable[[str], None]


class Unusable(ValueError):
    """What was asked for cannot be done; the message says what could be."""


class Source(ABC):
    """A source of steps.

    Parameters
    ----------
    options
        The command line, with what ``add_arguments`` added.
    say
        Called with what somebody who looks on should know.

    Raises
    ------
    Unusable
        Or another ValueError, with the cure, before anything is sent.
    """

    @classmethod
    @abstractmethod
    def add_arguments(cls, parser: ArgumentParser) -> None:
        """Say what its command line can hold."""

    @abstractmethod
    def __init__(self, options: Namespace, say: Say) -> None:
        """Look at the command line."""


class PlayedSource(Source):
    """A source that can be asked for the next stride: recorded or simulated.

    ``ahead`` is how many strides may be unacknowledged before the next is asked for, at full speed.
    """

    ahead = MAX_STEPS

    @abstractmethod
    def open_walk(self, trained_side: Side) -> Walk:
        """Begin to walk, in a session that trains this leg."""


class LiveSource(Source):
    """A source whose strides, or the signals they are made from, come when they come.

    ``settings`` say how to read what comes.
    """

    settings: IntakeSettings

    @abstractmethod
    async def read(self, intake: Intake) -> None:
        """Hand in all that comes; return when no more can come.

        It waits for senders that are not there yet and takes them up again when they come back.
        Raises Unusable for what only somebody at the machine can put right.
        """
