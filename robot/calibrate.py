"""`python -m robot calibrate --base BASE`: measures how a base answers, and stores it.

It turns slowly to both sides, stands still for some seconds, then drives and turns a little, twice.
That takes 1 m × 1 m and arms a real base: stand at its switch. Measured are the slowest turn that
its wheels follow, how late it answers, how large its wheels are (by its gyro), and how fast its
gyro turns at rest. Do it once for each base and floor, and after each repair.
Exit status: 0 it was measured; 1 it was not, or the base does not answer; 2 the command line cannot
be used; 130 Ctrl-C.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence

from robot.base_options import (
    add_base_arguments,
    clock_of,
    make_base,
    make_command_parser,
    print_line,
    print_notice,
)
from robot.bases import BASES, BadOption, BaseLost, MobileBase
from robot.behavior.body import Body
from robot.behavior.control_loop import control_loop
from robot.behavior.performer import Performer
from robot.calibration import BadCalibration, store_calibration
from robot.motion.base_response import MOST_STICTION_M_S, Response
from robot.motion.gesture import Gesture, Waypoint
from robot.motion.limits import TICK_S
from robot.motion.player import DONE
from robot.motion.twist import Twist

REST_S = 4.0
# Each speed of the wheels [m/s] is ordered for so long [s]; by then a base that follows has turned.
STICTION_STEP_M_S, STICTION_STEP_S = 0.004, 0.7
# It follows where it turns by this share of the order in the second half of that time.
FOLLOWS_SHARE = 0.5
STICTION_MARGIN = 1.25  # floors differ, and so do wheels (ours)
TIMES = 2
TURN_RAD = 1.5
MEASURED = Gesture(
    "calibrate",
    "Calibrate",
    (
        Waypoint(0.1, 0.0, 0.0, within_s=3.0),
        Waypoint(0.0, 0.0, 0.0, within_s=3.0),
        Waypoint(0.0, 0.0, TURN_RAD, within_s=3.5),
        Waypoint(0.0, 0.0, -TURN_RAD, within_s=4.5),
        Waypoint(0.0, 0.0, 0.0, within_s=3.5),
    ),
)


class NotMeasured(RuntimeError):
    """A base that could not be measured; the message says why."""


def measure(
    base: MobileBase, monotonic: Callable[[], float], sleep: Callable[[float], object]
) -> Response:
    """Return how an open base answers; a real one is armed by this.

    Parameters
    ----------
    base
        The base; it needs odometry.
    monotonic, sleep
        The clock [s] that it runs by, and how to wait by it.

    Raises
    ------
    NotMeasured
        Where it does not perform, or does not follow its orders.
    BaseLost
        Where it does not answer any more.
    """
    base.calibrate(Response())
    stiction_m_s = measure_stiction(Performer(base).body, monotonic, sleep)
    base.calibrate(Response(stiction_m_s=stiction_m_s))
    performer = Performer(base)
    by_both, by_gyro = 0.0, 0.0  # headings by the gyro times those by the wheels, and by themselves
    for _ in range(round(REST_S / TICK_S)):
        base.stop()
        base.read()
        sleep(TICK_S)
    for _ in range(TIMES):
        refused = performer.play_alone(MEASURED, monotonic())
        if refused:
            raise NotMeasured(f"The base may not move: {refused}.")
        for pause_s in control_loop(
            performer, monotonic, lambda: not performer.body.player.is_busy
        ):
            there = performer.body.state
            heading_rad = there.pose.heading_rad
            by_both += heading_rad * (heading_rad + there.sensors.slip_rad)
            by_gyro += heading_rad**2
            sleep(pause_s)
        if performer.body.player.outcome != DONE:
            raise NotMeasured(f"It did not get there: {performer.body.player.outcome}.")
    delay_s = performer.body.player.measured_delay_s
    if delay_s is None:
        raise NotMeasured("It moves, and not as it is ordered. Look at its wheels and the floor.")
    lag_s = min(Response().lag_s, delay_s)  # the rest is dead time: only their sum is seen
    return Response(
        dead_time_s=round(delay_s - lag_s, 4),
        lag_s=lag_s,
        wheel_scale=round(by_both / by_gyro, 4),  # the slope of a line through the origin
        gyro_bias_rad_s=round(base.read().sensors.drift_rad_s, 6),
        stiction_m_s=stiction_m_s,
    )


def measure_stiction(
    body: Body, monotonic: Callable[[], float], sleep: Callable[[float], object]
) -> float:
    """Return the slowest speed of its wheels [m/s] that a base follows both ways, with a margin.

    It turns on the spot, each step a little faster than the one before, by turns to both sides.

    Parameters
    ----------
    body
        The base with what stops it; this arms it.
    monotonic, sleep
        The clock [s] that it runs by, and how to wait by it.

    Raises
    ------
    NotMeasured
        Where something stops it, or where it follows none of the speeds.
    """
    body.safety.is_watched = True
    body.arm(monotonic())
    follows_from: dict[int, float] = {}
    for step in range(1, math.floor(MOST_STICTION_M_S / STICTION_MARGIN / STICTION_STEP_M_S) + 1):
        speed_m_s = step * STICTION_STEP_M_S
        for side in {1, -1} - set(follows_from):
            if _follows(
                body, Twist.of_wheels(-side * speed_m_s, side * speed_m_s), monotonic, sleep
            ):
                follows_from[side] = speed_m_s
        if len(follows_from) == 2:
            body.base.set_home()
            return round(STICTION_MARGIN * max(follows_from.values()), 4)
    raise NotMeasured(
        f"Its wheels do not follow {speed_m_s:g} m/s. Look at them, and at the floor."
    )


def _follows(
    body: Body, twist: Twist, monotonic: Callable[[], float], sleep: Callable[[float], object]
) -> bool:
    """Order a turn for a moment, and return whether the base follows it. Raises NotMeasured."""
    began_s, halfway_rad = monotonic(), None
    try:
        while (elapsed_s := monotonic() - began_s) < STICTION_STEP_S:
            there = body.read()
            if reason := body.safety.blocking_reason(there):
                raise NotMeasured(f"The base may not move: {reason}.")
            body.base.drive(twist)
            if halfway_rad is None and elapsed_s >= STICTION_STEP_S / 2:
                halfway_rad = there.pose.heading_rad
            sleep(TICK_S)
    finally:
        body.base.stop()
    turned_rad = body.read().pose.heading_rad - (halfway_rad or 0.0)
    return turned_rad / twist.w_rad_s >= FOLLOWS_SHARE * STICTION_STEP_S / 2


def format_result(response: Response) -> str:
    """Return a measurement as a line for people."""
    drift_deg_min = 60 * math.degrees(response.gyro_bias_rad_s)
    return (
        f"It answers after {1000 * response.delay_s:.0f} ms (dead time and lag), its wheels roll "
        f"{response.wheel_scale:.3f} m for each and follow orders from {response.stiction_m_s:.3f} "
        f"m/s on, and its gyro turns by {drift_deg_min:.1f}°/min at rest."
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure the base of the command line, and return the exit status."""
    parser = make_command_parser("calibrate", __doc__)
    able = sorted(
        name for name, base in BASES.items() if base.abilities.moves and base.abilities.closed_loop
    )
    add_base_arguments(parser, able)
    options = parser.parse_args(arguments)
    monotonic, sleep = clock_of(options.base)
    try:
        with make_base(options, monotonic) as base:
            response = measure(base, monotonic, sleep)
            path = store_calibration(base, response)
    except (BaseLost, BadCalibration, NotMeasured) as problem:
        print_notice(str(problem))
        return 1
    except BadOption as problem:
        print_notice(str(problem))
        return 2
    except KeyboardInterrupt:
        return 130
    print_line(f"{format_result(response)}\nStored in {path}.", sys.stdout)
    return 0
