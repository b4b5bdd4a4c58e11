"""The interface of all bases. Nothing above knows which base it drives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from argparse import ArgumentParser, Namespace, _ArgumentGroup
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar, Self

from robot.motion.base_response import Response
from robot.motion.lights_and_sounds import Color, Note
from robot.motion.pose import Pose
from robot.motion.twist import Twist


class BaseLost(RuntimeError):
    """A base that does not answer any more; the message says what to look at."""


class BadOption(ValueError):
    """An option of a command line that no base has; the message says which it has."""


@dataclass(frozen=True, slots=True)
class Abilities:
    """What a base is and can do; what it cannot do safely is refused.

    Parameters
    ----------
    simulated
        Whether nothing in it can touch anyone; only such a base may arm itself.
    moves
        Whether it can drive and turn, as gestures need.
    announces
        Whether it has lights and sounds, which announce that it is about to move.
    notes
        Whether it plays the notes of a gesture's score; else a sound of its own announces each.
    answers
        Whether it has a face, a voice or arms, by which it answers beside its motion.
    real_time
        Whether it runs by the computer's clock, so it cannot run on a virtual one.
    closed_loop
        Whether it reports where it is. Without that its pose is dead reckoning by its orders.
    bumpers
        Whether it has bumpers.
    holonomic
        Whether it also moves sideways, whichever way it faces.
    """

    simulated: bool
    moves: bool
    announces: bool = False
    notes: bool = False
    answers: bool = False
    real_time: bool = False
    closed_loop: bool = True
    bumpers: bool = False
    holonomic: bool = False

    def check(self, twist: Twist) -> None:
        """Raise ValueError for a velocity to the left, unless the base is holonomic.

        Whoever orders that expects it to come about; to drop it would move the base elsewhere.
        """
        if twist.vy_m_s and not self.holonomic:
            raise ValueError("This base does not move sideways: order 0 m/s to the left.")


class Indication(StrEnum):
    """What a base shows by its lights."""

    WAITING = "waiting"  # it may not move now
    READY = "ready"
    MOVING = "moving"  # or about to
    STOPPED = "stopped"  # until a person arms it


@dataclass(frozen=True, slots=True)
class Answer:
    """How to answer a window beside motion: by a face, a voice, a head or arms.

    Parameters
    ----------
    gesture
        Name of the gesture that begins now.
    is_glad
        Whether the window was above the threshold; only then may it sound or look glad. None for
        what answers no window: then it says nothing.
    is_quiet
        Whether it makes no sound.
    strength
        Share of the gesture's size, 0.1 to 1.
    """

    gesture: str
    is_glad: bool | None
    is_quiet: bool = False
    strength: float = 1.0


@dataclass(frozen=True, slots=True)
class SensorState:
    """What a base reports beside its motion. By default nothing is wrong, and nothing known.

    Parameters
    ----------
    hazards
        What must stop it at once and holds now, or has held since the last reading, as codes:
        ``bump``, ``cliff``, ``wheel_drop``, ``over_current``, ``unordered_motion``.
    refusal
        Why it must not move at all, as a code; empty where it may.
    stop_pressed
        Whether its stop button is pressed.
    battery_v
        Voltage of its battery [V]; None where unknown.
    is_charging
        Whether a charger is connected.
    silent_s
        Time since it last reported anything [s].
    slip_rad
        Heading by its wheels minus heading by its gyro, from home [rad].
    doubt_rad
        How far wheels and gyro disagree about its heading since home [rad], beyond what wheels of
        unequal size explain.
    drift_rad_s
        How fast its gyro turns by itself, as far as is known [rad/s].
    push_n
        Force with which its motors push, by the current that they draw [N]; 0 where unknown.
    """

    hazards: frozenset[str] = frozenset()
    refusal: str = ""
    stop_pressed: bool = False
    battery_v: float | None = None
    is_charging: bool = False
    silent_s: float = 0.0
    slip_rad: float = 0.0
    doubt_rad: float = 0.0
    drift_rad_s: float = 0.0
    push_n: float = 0.0


@dataclass(frozen=True, slots=True)
class BaseState:
    """Pose of a base from home, by its odometry; its velocity; its other sensors."""

    pose: Pose
    twist: Twist
    sensors: SensorState = SensorState()


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """True pose of a simulated base from home, and the largest distance it has had [m]."""

    pose: Pose
    farthest_m: float


class MobileBase(ABC):
    """A base that drives and turns; a holonomic one moves sideways, too.

    As a context manager it is opened, and left standing still however the block ends.
    """

    name: ClassVar[str]
    abilities: Abilities  # of the class, or of an object with other topics
    port: str = ""  # address of its port or bridge, where it has one; set before it is opened
    response: Response = Response()  # how late it answers
    on_bytes: Callable[[bytes], None] | None = None  # gets the bytes that it sends, if any

    @abstractmethod
    def __init__(self, monotonic: Callable[[], float]) -> None:
        """Make one that is not open yet, with a clock [s]."""

    @classmethod  # noqa: B027 (not every base has options)
    def add_arguments(cls, group: ArgumentParser | _ArgumentGroup) -> None:
        """Add the base's own options to a command line."""

    def configure(self, options: Namespace) -> None:
        """Apply the options, before it is opened. Raises BadOption."""
        self.port = options.port

    @property
    def identity(self) -> str:
        """Which base this is, once it is open: what was measured of it is stored under this."""
        return self.name

    def calibrate(self, response: Response) -> None:
        """Apply what was measured of its motion. Its present place becomes home."""
        self.response = response

    def __enter__(self) -> Self:
        """Open it. Raises BaseLost where it cannot be opened at all."""
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave it standing still."""
        try:
            self.stop()
        finally:
            self.close()

    def open(self) -> None:  # noqa: B027 (not every base has what could be opened)
        """Open its port, bridge or page. Raises BaseLost."""

    def close(self) -> None:  # noqa: B027
        """Close what ``open`` has opened; it stands still by now."""

    @property
    def counters(self) -> Mapping[str, int]:
        """How often something went wrong between it and us, by name."""
        return {}

    @property
    def problem(self) -> str:
        """Why it cannot be reached, for people; empty where it can."""
        return ""

    @abstractmethod
    def drive(self, twist: Twist) -> Twist:
        """Order a velocity in place of the last one, and return what was really ordered.

        An order holds for ``ORDER_HOLDS_S``.

        Parameters
        ----------
        twist
            The velocity; one that is not finite is an order to stand still.

        Returns
        -------
        Twist
            The velocity after clipping and rounding.

        Raises
        ------
        BaseLost
            Where the base does not answer any more.
        ValueError
            For a velocity that it cannot have (``Abilities.check``).
        """

    @abstractmethod
    def stop(self) -> None:
        """Stand still at once. Never raises."""

    @abstractmethod
    def read(self) -> BaseState:
        """Return its state now. Raises BaseLost."""

    @abstractmethod
    def set_home(self) -> None:
        """Make the present place home. A simulated base is put back to its own home."""

    def ground_truth(self) -> GroundTruth | None:
        """Return its true pose where that is known: in a simulation."""
        return None

    def light(self, first: Color, second: Color) -> None:  # noqa: B027 (not every base can)
        """Show colors of a gesture's score, until ``show`` or the next ones. Never raises.

        Parameters
        ----------
        first, second
            Colors of its two lights.
        """

    def play(self, note: Note) -> None:  # noqa: B027 (not every base can)
        """Play a note of a gesture's score. Never raises."""

    def show(self, indication: Indication, *, aloud: bool) -> None:  # noqa: B027 (not every base can)
        """Show a state by its lights. Never raises.

        Parameters
        ----------
        indication
            The state.
        aloud
            Whether a sound announces it too, if there is one for it.
        """

    def answer(self, answer: Answer) -> None:  # noqa: B027 (not every base can)
        """Begin to answer, in place of the last answer; ``show`` ends it. Never raises or waits."""
