"""Plays a gesture: the twist to order now, given the time and the pose of the base."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

from robot.marking import gettext_noop
from robot.motion.base_response import AT_ONCE, OrdersInFlight, Response
from robot.motion.delay_meter import DelayMeter
from robot.motion.following import NEAR_M, NEAR_RAD, Follower
from robot.motion.gesture import MIN_PACE, Gesture, Waypoint
from robot.motion.limits import AT_HOME_M, AT_HOME_RAD, Limits
from robot.motion.path import Drive, Segment, Turn, plan_path
from robot.motion.pose import HOME, Pose, wrap
from robot.motion.twist import STILL, Twist

DONE = "done"
OUT_OF_TIME = gettext_noop("out_of_time")
BAD_ODOMETRY = "bad_odometry"

# At home it waits for the orders that are still on their way, and this much longer [s]; then it
# turns once more if they have carried it past.
SETTLE_S = 0.1
# One that is nearly at home when its time is over goes the rest at half its pace, so long [s].
LATE_RETURN_S = 2.0
LATE_PACE = 0.5


class Player:
    """Plays one gesture at a time, closed on odometry.

    A base answers late. So each order is planned from the pose that the base will have once it has
    answered the orders on their way, as if there were no delay (a Smith predictor); odometry then
    corrects what the prediction missed. How late it is, is measured on while it moves.

    A holonomic base goes the same ways, for turns are what is seen; only what it is beside its way,
    or beside home, it corrects sideways, without a turn.

    ``step`` is to be called some 50 times a second, whether a gesture is played or not; it never
    exceeds the limits, and slows down by itself after the last waypoint.

    Parameters
    ----------
    limits
        Speeds and accelerations that every order keeps to.
    response
        How late the base answers, as far as is known before it moves.
    is_holonomic
        Whether it moves sideways, too.
    """

    def __init__(
        self, limits: Limits, response: Response = AT_ONCE, *, is_holonomic: bool = False
    ) -> None:
        self.limits, self._is_holonomic = limits, is_holonomic
        self._follower = Follower(response.stiction_m_s, is_holonomic=is_holonomic)
        # One that does not creep stops short, too: a base that turned round at once would seem to
        # be held.
        self._pause_s = 0.0 if self._follower.creeps else SETTLE_S
        self._in_flight = OrdersInFlight(response.delay_s)
        self._meter = DelayMeter()
        self.gesture: Gesture | None = None
        self.outcome = ""  # of the gesture that was played last
        self.twist = STILL  # what was ordered last
        self._ramped = STILL  # the same before it was lifted over the stiction
        self._time_s: float | None = None
        self._waypoints: deque[Waypoint] = deque()
        self._segments: deque[Segment] = deque()
        self._waypoint: Waypoint | None = None
        self._until_s = 0.0  # the waypoint's time is over
        self._there_s: float | None = None  # when its segments were done
        self._begins_s = 0.0  # before that it stands still, announced
        self._verdict = ""  # the outcome, set while the base comes to rest
        self._turns_rad = 0.0  # full turns that were made before the gesture
        self._pace = 1.0
        self._is_late = False  # its time is over, and it was nearly at home
        self._is_corrected = False  # it has driven the rest of the way home

    @property
    def is_busy(self) -> bool:
        """Whether a gesture is played, or the base comes to rest after it."""
        return self.gesture is not None

    def start(
        self,
        gesture: Gesture,
        time_s: float,
        pose: Pose,
        after_s: float = 0.0,
        pace: float = 1.0,
    ) -> None:
        """Begin a gesture around home, which is odometry's zero. Raises RuntimeError while busy.

        Parameters
        ----------
        gesture
            What to play.
        time_s
            The player's clock [s].
        pose
            Where the base is now: full turns that it has made do not count.
        after_s
            How long it stands still first [s].
        pace
            Share of the limits to go at, at most, above 0 and up to 1; its time grows with it.
        """
        if self.gesture is not None:
            raise RuntimeError(f"{self.gesture.name} is being played.")
        self.gesture, self._verdict, self._pace = gesture, "", pace
        self._is_late = self._is_corrected = False
        self._turns_rad = pose.heading_rad - wrap(pose.heading_rad)
        self._waypoints = deque(gesture.waypoints)
        self._begins_s = time_s + after_s
        self._next_waypoint(HOME, self._begins_s)

    def stop(self, reason: str) -> None:
        """End the gesture: from now on the base slows down as its limits allow."""
        if self.is_busy and not self._verdict:
            self._verdict = reason

    def halt(self, reason: str) -> None:
        """End the gesture and order a stop at once, without slowing down first."""
        if self.is_busy:
            self._end(self._verdict or reason)
        self.twist = self._ramped = STILL

    def step(self, time_s: float, pose: Pose) -> Twist:
        """Return the twist to order now.

        Parameters
        ----------
        time_s
            The player's clock [s]; where it goes backwards, nothing speeds up.
        pose
            Where the base is, by its odometry. One that is not finite halts it.
        """
        elapsed_s = 0.0 if self._time_s is None else time_s - self._time_s
        self._time_s = time_s
        if not pose.is_finite:
            self.halt(BAD_ODOMETRY)
            self._in_flight.add(STILL, time_s)
            return STILL
        self._meter.add(self.twist, pose, time_s)
        if self._meter.delay_s is not None:
            self._in_flight.delay_s = self._meter.delay_s
        limits, wanted = self._wanted_twist(time_s, self._in_flight.predict(pose, time_s))
        self._ramped = limits.approach(self._ramped, wanted, elapsed_s)
        self.twist = self._follower.lift(self._ramped, wanted)
        if self._verdict and self._ramped.is_still:
            self._end(self._verdict)
        self._in_flight.add(self.twist, time_s)
        return self.twist

    @property
    def measured_delay_s(self) -> float | None:
        """How late the base answers [s], by its motion so far; None where that does not tell."""
        return self._meter.delay_s

    def answered(self, time_s: float) -> Twist:
        """Return the order that the base should follow now, given how late it answers."""
        return self._in_flight.answered(time_s)

    def _wanted_twist(self, time_s: float, pose: Pose) -> tuple[Limits, Twist]:
        """Return the limits and the wanted twist, given where the base will be."""
        here = replace(pose, heading_rad=pose.heading_rad - self._turns_rad)
        while self._waypoint is not None and not self._verdict:
            limits = self.limits.scaled(self._share(self._waypoint))
            if time_s < self._begins_s:
                return limits, STILL
            if self._there_s is None and time_s > self._until_s:
                if self._is_late or self._waypoints or not _is_near_home(here):
                    self._verdict = OUT_OF_TIME
                else:
                    self._is_late, self._until_s = True, time_s + LATE_RETURN_S
            elif self._segments:
                wanted = self._follower.follow(self._segments[0], here, limits)
                if wanted is not None:
                    return limits, wanted
                self._segments.popleft()
            elif self._there_s is None:
                self._there_s = time_s
            elif time_s - self._there_s < max(
                self._waypoint.hold_s, self._pause_s if self._waypoints else self._settle_s
            ):
                return limits, STILL
            elif not self._waypoints and (
                rest := self._rest_of_the_way(here, self._waypoint.heading_rad)
            ):
                self._segments.extend(rest)
                self._there_s = None
            else:
                self._next_waypoint(self._waypoint.pose, time_s)
        return self.limits, STILL

    def _rest_of_the_way(self, here: Pose, heading_rad: float) -> list[Segment]:
        """Return what is left at home, once the base has come to rest: ahead or back, and a turn.

        A holonomic base goes what it is beside home, too. One that answers sooner than was assumed
        has stopped too early; it drives the rest once.
        """
        rest: list[Segment] = []
        left_m = HOME.seen_from(Pose(here.x_m, here.y_m)).x_m
        away_m = here.distance_m(HOME) if self._is_holonomic else abs(left_m)
        if away_m > NEAR_M and not self._is_corrected:
            self._is_corrected = True
            rest.append(Drive(HOME.x_m, HOME.y_m, heading_rad, left_m))
        if rest or abs(heading_rad - here.heading_rad) > NEAR_RAD:
            rest.append(Turn(heading_rad, 0.0))
        return rest

    def _next_waypoint(self, start: Pose, time_s: float) -> None:
        self._there_s = None
        if not self._waypoints:
            self._waypoint, self._verdict = None, DONE
            return
        self._waypoint = self._waypoints.popleft()
        self._segments = deque(plan_path(start, self._waypoint.pose))
        slower = self._waypoint.pace / self._share(self._waypoint)
        self._until_s = time_s + self._waypoint.within_s * slower + self._settle_s

    @property
    def _settle_s(self) -> float:
        return self._in_flight.delay_s + SETTLE_S

    def _share(self, waypoint: Waypoint) -> float:
        """Return the share of the limits for a waypoint."""
        return max(MIN_PACE, min(waypoint.pace, self._pace) * (LATE_PACE if self._is_late else 1.0))

    def _end(self, outcome: str) -> None:
        self.gesture, self._waypoint = None, None
        self.outcome, self._verdict = outcome, ""
        self._waypoints.clear()
        self._segments.clear()


def _is_near_home(pose: Pose) -> bool:
    return pose.distance_m(HOME) <= AT_HOME_M and pose.turn_rad(HOME) <= AT_HOME_RAD
