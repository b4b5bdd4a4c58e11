"""Drives a base home while a person holds a button: it looks, rolls by odometry, and looks again.

It goes ahead and turns on the spot, at the speeds of a manual drive, and does not back up. A look
while it stands says where home is; odometry carries that along a turn, a straight way and a turn,
until the next look. Time is a parameter.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple, Protocol

import numpy as np

from robot.homing.codes import (
    CAMERA_CODES,
    CONTRADICTED,
    DRIVING,
    LOOKING,
    NO_TAG,
    NOT_LEVEL,
    NOT_REACHED,
    SEARCHING,
    THERE,
    TOO_FAR,
    UNSURE,
)
from robot.homing.home_view import Carried, HomeView
from robot.homing.sighting import Sighting
from robot.homing.still_frames import Look
from robot.homing.tag_pose import UNLIKELY, Matrix, Place, find_place, mount_matrix, solve_tag
from robot.motion.base_response import OrdersInFlight, Response
from robot.motion.delay_meter import DelayMeter
from robot.motion.following import Follower
from robot.motion.limits import Limits
from robot.motion.path import Drive, Segment, Turn
from robot.motion.pose import HOME, Pose, wrap
from robot.motion.twist import STILL, Twist

# As near as a gesture has to end (docs/reference/kobuki.md#beside-a-person: 2 cm and 2°), less what
# a look errs by there (1 cm and 1°: tests/bench/test_tag_home.py).
THERE_M, THERE_RAD = 0.01, math.radians(1.0)
# Standard errors of the last look, as its corners allow: half of what is left of those 2 cm and 2°.
SURE_M, SURE_RAD = 0.006, math.radians(0.5)
# A look that errs by more than this [m] is no reason to drive anywhere. (Ours: the box has room.)
ROUGH_M = 0.4
# At the speeds of a manual drive (robot/behavior/manual_drive.py), and a gesture's ramps.
LIMITS = Limits(v_m_s=0.1, w_rad_s=0.5)
LOOKS = 8  # ways that it tries; three are enough in nine of ten (the same place)
# Further than this [m] from home it is carried: odometry errs by 2 % of the way, and a tag of 16 cm
# is small. (Ours.)
FARTHEST_M = 1.7
# What does not see its tag turns by so much [rad], and looks: a circle, and one halfway between.
# (Ours: of 300 places that see one, simulated, 5 % do in less than 30°; tests/support/tag_room.py)
SEARCH_RAD = math.radians(30.0)
LOOKS_AROUND = round(math.tau / SEARCH_RAD)
# By its tag and by its wheels it has come equally far and turned equally much, but for this much
# [m, and m for each m of way, and of distance to the tag; rad]. More is a tag that was moved or is
# not of its size, or a wheel that slipped. (Ours: twice the largest that was measured with a right
# tag, the same place.)
DOUBT_M, DOUBT_M_M, DOUBT_RAD = 0.02, 0.02, math.radians(3.0)
# At rest its wheels are slower than this [m/s] (a tick of the encoder every 20 ms is 4 mm/s).
RESTS_M_S = 0.005


class Eye(Protocol):
    """What looks for tags."""

    def watch(self, now_s: float) -> None:
        """Look, for the next seconds."""

    def take(self) -> list[Sighting]:
        """Return the sightings since the last call, oldest first."""


class _Seen(NamedTuple):
    """A look that said where home is."""

    here: Pose  # by odometry
    tag: Matrix  # in the camera's frame (4 × 4)
    home: Pose  # by odometry
    error_rad: float  # of the heading


class Homing:
    """Drives one base home by its tag.

    Parameters
    ----------
    view
        How its tag is seen from home.
    eye
        What looks for tags.
    response
        How late the base answers.

    Attributes
    ----------
    code
        What it does, or why it stands, as a code; empty before it was ordered.
    has_given_up
        Whether it stands until the button is let go.
    """

    def __init__(self, view: HomeView, eye: Eye, response: Response) -> None:
        self._view, self._eye = view, eye
        self._follower = Follower(response.stiction_m_s)
        self._in_flight, self._meter = OrdersInFlight(response.delay_s), DelayMeter()
        self.code = ""
        self.end()

    def end(self) -> None:
        """Forget the way: the button was let go, or something stopped it. What it came to stays."""
        if self.code in (LOOKING, DRIVING, SEARCHING):
            self.code = ""
        self.has_given_up = False
        self._look: Look | None = None
        self._way: deque[Segment] = deque()
        self._seen: _Seen | None = None
        self._looks = 0
        self._searches, self._rolled_m = 0, 0.0
        self._ramped = self._ordered = STILL
        self._last: tuple[float, Pose] | None = None

    @property
    def is_home(self) -> bool:
        """Whether it has come home while the button was held."""
        return self.has_given_up and self.code == THERE

    def answered(self, now_s: float) -> Twist:
        """Return the order that the base should follow now, given how late it answers."""
        return self._in_flight.answered(now_s)

    def step(self, now_s: float, pose: Pose, twist: Twist) -> Twist:
        """Return the twist to order now; to be called 50 times a second while the button is held.

        Parameters
        ----------
        now_s
            The time [s].
        pose
            Where the base is by odometry; its zero does not matter, but stays.
        twist
            How it moves, by its sensors.
        """
        self._eye.watch(now_s)
        elapsed_s = 0.0
        if self._last is None:
            self.code = LOOKING
        else:
            elapsed_s = now_s - self._last[0]
            self._rolled_m += pose.distance_m(self._last[1])
        self._last = now_s, pose
        self._meter.add(self._ordered, pose, now_s)
        if self._meter.delay_s is not None:
            self._in_flight.delay_s = self._meter.delay_s
        wanted = self._wanted(now_s, pose, twist)
        self._ramped = LIMITS.approach(self._ramped, wanted, elapsed_s)
        self._ordered = self._follower.lift(self._ramped, wanted)
        self._in_flight.add(self._ordered, now_s)
        return self._ordered

    def _wanted(self, now_s: float, pose: Pose, twist: Twist) -> Twist:
        sightings = self._eye.take()
        if self.has_given_up:
            return STILL
        ahead = self._in_flight.predict(pose, now_s)
        while self._way:
            wanted = self._follower.follow(self._way[0], ahead, LIMITS)
            if wanted is not None:
                self._look = None
                return wanted
            self._way.popleft()
        self._look_around(now_s, pose, twist, sightings)
        return STILL

    def _look_around(
        self, now_s: float, pose: Pose, twist: Twist, sightings: list[Sighting]
    ) -> None:
        """Look while it stands; where a look is over, find the way on."""
        if not self._ramped.is_still or twist.fastest_wheel_m_s > RESTS_M_S:
            self._look = None
            return
        if self._look is None:
            size = self._view.lens.width_px, self._view.lens.height_px
            self._look = Look(self._view.tag, size, now_s)
        for sighting in sightings:
            self._look.add(sighting)
        problem = self._look.problem(now_s)
        if problem == NO_TAG:
            self._search(pose)
        elif problem in CAMERA_CODES:
            self.code, self._look = problem, None  # it may come back
        elif problem:
            self._give_up(problem)
        elif self._look.is_whole:
            self._go_on(pose, self._look.corners_px)
        elif self._look.has_frames and self.code not in CAMERA_CODES:
            self.code = SEARCHING if self._searches else LOOKING

    def _search(self, pose: Pose) -> None:
        """Turn a little, or give up after two circles."""
        self._searches += 1
        if self._searches == 2 * LOOKS_AROUND:
            self._give_up(NO_TAG)
            return
        self.code = SEARCHING
        by_rad = SEARCH_RAD * (1.5 if self._searches == LOOKS_AROUND else 1.0)
        self._way.append(Turn(pose.heading_rad + by_rad, by_rad))

    def _go_on(self, here: Pose, corners_px: Matrix) -> None:
        """Find the way home from where a look was; here it is, or here it gives up."""
        seen, self._look = self._seen, None
        expected = None if seen is None else here.seen_from(seen.home)
        found = find_place(corners_px, self._view, expected)
        if found is None:
            self._give_up(NOT_LEVEL)
            return
        tag = solve_tag(corners_px, self._view.size_m, self._view.lens)[0].tag
        if seen is not None and self._contradicts(seen, here, found, tag):
            self._give_up(CONTRADICTED)
            return
        away_m, turned_rad = found.pose.distance_m(HOME), found.pose.turn_rad(HOME)
        self._looks += 1
        if found.error_m > ROUGH_M:
            self._give_up(UNSURE)
        elif away_m <= THERE_M and turned_rad <= THERE_RAD:
            is_sure = found.error_m <= SURE_M and found.error_rad <= SURE_RAD
            self._give_up(THERE if is_sure else UNSURE)
        elif away_m > FARTHEST_M or self._looks > LOOKS:
            self._give_up(TOO_FAR if away_m > FARTHEST_M else NOT_REACHED)
        else:
            home = _home_of(here, found.pose)
            self._seen = _Seen(here, tag, home, found.error_rad)
            self._searches, self._rolled_m = 0, 0.0
            self.code = DRIVING
            self._way.extend(_way_home(here, home, away_m))

    def _contradicts(self, seen: _Seen, here: Pose, found: Place, tag: Matrix) -> bool:
        """Whether the tag has come elsewhere than odometry has it.

        By its place in the frames, which is much surer than how it is turned: a tag in the room
        stays where it was; one on the base goes as far as the base did.
        """
        expected = here.seen_from(seen.home)
        sure_rad = DOUBT_RAD + UNLIKELY * (seen.error_rad + found.error_rad)
        if found.pose.turn_rad(expected) > sure_rad:
            return True
        view, away_m = self._view, float(np.linalg.norm(seen.tag[:3, 3]))
        mount = mount_matrix(view.mount, view.carried)
        if view.carried is Carried.CAMERA:
            off_m = math.dist(_place(seen.here, mount @ seen.tag), _place(here, mount @ tag))
        else:
            by_wheels = math.dist(_place(seen.here, mount), _place(here, mount))
            off_m = abs(by_wheels - float(np.linalg.norm(tag[:3, 3] - seen.tag[:3, 3])))
        return off_m > DOUBT_M + DOUBT_M_M * (self._rolled_m + away_m)

    def _give_up(self, code: str) -> None:
        self.code, self.has_given_up = code, True


def _home_of(here: Pose, from_home: Pose) -> Pose:
    """Return where home is by odometry, for a base that is ``from_home`` and by odometry here."""
    heading_rad = here.heading_rad - from_home.heading_rad
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    return Pose(
        here.x_m - from_home.x_m * cos + from_home.y_m * sin,
        here.y_m - from_home.x_m * sin - from_home.y_m * cos,
        heading_rad,
    )


def _way_home(here: Pose, home: Pose, away_m: float) -> list[Segment]:
    """Return the turns and the way ahead that lead home."""
    way: list[Segment] = []
    heading_rad = here.heading_rad
    if away_m > THERE_M:
        bearing_rad = math.atan2(home.y_m - here.y_m, home.x_m - here.x_m)
        by_rad = wrap(bearing_rad - heading_rad)
        heading_rad += by_rad
        way += [Turn(heading_rad, by_rad), Drive(home.x_m, home.y_m, heading_rad, away_m)]
    by_rad = wrap(home.heading_rad - heading_rad)
    return [*way, Turn(heading_rad + by_rad, by_rad)]


def _place(pose: Pose, there: Matrix) -> tuple[float, float]:
    """Return the place by odometry of what is ``there`` (4 × 4) on a base at a pose."""
    x_m, y_m = float(there[0, 3]), float(there[1, 3])
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    return pose.x_m + x_m * cos - y_m * sin, pose.y_m + x_m * sin + y_m * cos
