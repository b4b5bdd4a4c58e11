"""The base classes of sources, which are made from a command line and supply strides."""

from __future__ import annotations

from abc import ABC, abstractmethod
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from rehab.sources.client import NextStride
from rehab.sources.reporting import Notify
from rehab.training.steps import Side
from robot.wire.limits import MAX_STEPS

if TYPE_CHECKING:
    from rehab.sources.intake import Intake, IntakeSettings


class Source(ABC):
    """A source of steps.

    Parameters
    ----------
    options
        The command line, with what ``add_arguments`` added.
    notify
        Called with lines for the person who runs the source.

    Raises
    ------
    SourceError
        Or another ValueError, with the cure, before anything is sent.

    ``simulated`` is whether nobody walks: what it sends is never counted as a person's walk.
    """

    simulated: bool = False

    @classmethod
    @abstractmethod
    def add_arguments(cls, parser: ArgumentParser) -> None:
        """Add the options of this source to a command line."""

    @abstractmethod
    def __init__(self, options: Namespace, notify: Notify) -> None:
        """Read the command line."""


class PlayedSource(Source):
    """A source that can be asked for the next stride: recorded or simulated.

    ``max_unacknowledged`` is how many strides may be unacknowledged before the next is asked for,
    at full speed.
    """

    max_unacknowledged = MAX_STEPS

    @abstractmethod
    def open_walk(self, trained_side: Side) -> NextStride:
        """Return the strides of a session that trains this leg, one a call."""


class LiveSource(Source):
    """A source whose strides, or the signals that they are measured from, come in real time.

    ``settings`` define how to read what comes.
    """

    settings: IntakeSettings

    @abstractmethod
    async def read(self, intake: Intake) -> None:
        """Pass everything that comes to the intake; return when no more can come.

        It waits for senders that are not there yet and reconnects to them. Raises SourceError for
        a problem that only a person at the machine can solve.
        """
