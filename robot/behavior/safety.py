"""Whether a robot may move, and what stops it. Time is a parameter; nothing here reads or waits.

A *latch* stops the base at once and holds until a person arms it again: a hazard that the base
detected, a motion that was not ordered, a person's stop. A simulated base, beside which nobody
stands, is put back and armed by itself, unless a person stopped it. An *obstacle* keeps the next
gesture from starting as long as it lasts. Numbers without a source of their own are those of
docs/reference/kobuki.md#beside-a-person; no standard gives any for a base of this size
(docs/reference/kobuki.md#standards).
"""

from __future__ import annotations

from collections.abc import Iterator

from robot.bases.base import Abilities, BaseState
from robot.behavior.resistance import Resistance
from robot.motion.gesture import Gesture
from robot.motion.limits import AT_HOME_M, AT_HOME_RAD, ORDER_HOLDS_S, TETHER_M
from robot.motion.pose import HOME
from robot.motion.twist import Twist

# Light and sound come this long before a gesture [s]: a sudden motion may startle the walker.
ANNOUNCE_S = 0.5

# Nothing heard of the base for this long [s]. The reference driver allows 0.1 s
# (docs/reference/kobuki.md#watchdogs); twice that forgives a busy computer (largest gap measured:
# 0.03 s) and keeps the whole within 0.35 s.
BASE_SILENT_S = 0.2
# Nothing heard of the server for this long [s]. A heartbeat comes every 0.25 s, at most
# 0.4 s late; the order to stand still takes up to 0.05 s to the wheels, which makes 0.75 s at most.
SERVER_SILENT_S = 0.65
# A computer that hung for this long [s]: the base has stopped by itself, a gesture that was
# interrupted is not resumed (ISO 13850), and what waited in the socket begins none.
LAPSED_S = ORDER_HOLDS_S

SLIP_RAD = 0.175  # 10°: wheels and gyro disagree about a gesture's turns
# Wheels and gyro disagree this much about where home's heading is [rad]: one of them is wrong, and
# nobody knows which. 2°, as near as a gesture has to end.
LOST_RAD = 0.035

# Of four lithium cells [V] (docs/reference/kobuki.md#battery). A battery that was low has to come
# back to WARN: at rest it recovers by itself, and would be low again with the next gesture.
BATTERY_FULL_V = 16.5
BATTERY_WARN_V = 14.0
BATTERY_LOW_V = 13.5
BATTERY_EMPTY_V = 13.2
EMPTY_S = 1.0  # a voltage dips when wheels start (our choice)

# An arming sooner than this after the robot stopped itself [s] was given before anyone could look
# (our choice; people react to what they see after 0.2 s and more).
REARM_AFTER_S = 1.0

# Without odometry a gesture is short: half its size, and within the limits no longer than this [s];
# and after this many gestures since it was armed a person has to look where it is (our choice: with
# an error of 10 % of each way, 20 of them come to half the tether).
OPEN_LOOP_SHARE = 0.5
OPEN_LOOP_MAX_S = 4.0
OPEN_LOOP_MAX_GESTURES = 20

# Latches; hazards that a base detects have its own codes.
STOPPED = "stopped"  # by a person
BUTTON = "button"  # by a person, at the base
BASE_SILENT = "base_silent"
LAPSED = "order_lapsed"
TETHER = "tether"
STALLED = "stalled"
SLIPPED = "slipped"
BATTERY_EMPTY = "battery_empty"

# Obstacles.
DISARMED = "disarmed"  # a real base that no person has armed since it was connected
UNWATCHED = "unwatched"  # a real base, and no PT's page is open
CHARGING = "charging"
BATTERY_LOW = "battery_low"
AWAY = "away_from_home"
OPEN_LOOP = "open_loop"  # too long a gesture for a base without odometry
PLACE_UNKNOWN = "place_unknown"  # a person has to look at such a base, and arm it


def is_server_silent(heard_s: float, now_s: float) -> bool:
    """Return whether the server was heard too long ago [s] for the robot to move."""
    return now_s - heard_s > SERVER_SILENT_S


def battery_share(battery_v: float) -> float:
    """Return how full a battery of that voltage [V] is, 0 to 1.

    Source: docs/reference/kobuki.md#battery.
    """
    share = (battery_v - BATTERY_EMPTY_V) / (BATTERY_FULL_V - BATTERY_EMPTY_V)
    return min(max(0.05 + 0.95 * share, 0.0), 1.0)


class Safety:
    """Decides whether one base may move, and what stops it.

    Parameters
    ----------
    abilities
        Of the base. A simulated one arms itself and needs nobody to watch.

    Attributes
    ----------
    latch
        What stopped it, as a code; empty where nothing did. The first cause stays.
    is_armed
        Whether a person has armed it.
    is_watched
        Whether a PT's page is open.
    refused_arms
        How many armings were refused.
    """

    def __init__(self, abilities: Abilities) -> None:
        self._abilities = abilities
        self.latch = ""
        self.is_armed = abilities.simulated
        self.is_watched = False
        self.refused_arms = 0
        self._fault_s: float | None = None  # when it stopped itself; None for a person's stop
        self._checked_s: float | None = None
        self._since: dict[str, float] = {}  # when each fault that holds now began
        self._slip_rad = 0.0  # when the gesture began
        self._resistance = Resistance()
        self._gestures_started = 0  # gestures since it was armed
        self._battery_was_low = False

    def stop(self, reason: str) -> None:
        """Latch for a person's stop. Repeating it changes nothing."""
        self.latch = self.latch or reason
        self._fault_s = None

    def latch_fault(self, reason: str, now_s: float) -> None:
        """Latch for a reason that the robot itself found."""
        if not self.latch:
            self.latch, self._fault_s = reason, now_s

    def disconnect(self) -> None:
        """Reset what depends on the server: a real base has to be armed again."""
        self.disarm()
        self.is_watched = False

    def disarm(self) -> None:
        """Let a real base wait for a person."""
        self.is_armed = self._abilities.simulated

    def arm(self, now_s: float, state: BaseState) -> str:
        """Arm the base for a person, unless something speaks against it.

        What stopped it has to be over. A gesture that was stopped is not resumed.

        Parameters
        ----------
        now_s
            The time [s].
        state
            What the base reports.

        Returns
        -------
        str
            Why it cannot be armed, as a code; empty where it is armed now.
        """
        reason = self._base_fault(state)
        if not reason and self._fault_s is not None and now_s - self._fault_s < REARM_AFTER_S:
            reason = self.latch
        if reason:
            self.refused_arms += 1
            self.latch_fault(reason, now_s)
            return reason
        self.latch, self._fault_s, self.is_armed = "", None, True
        self._gestures_started = 0
        self._since.clear()
        return ""

    def may_recover(self, now_s: float) -> bool:
        """Whether a base is to be put back that stopped itself so long ago: a simulated one is."""
        since_s = self._fault_s if self.latch not in ("", BUTTON) else None
        return (
            self._abilities.simulated and since_s is not None and now_s - since_s >= REARM_AFTER_S
        )

    def recover(self, now_s: float, state: BaseState) -> None:
        """Arm a base that was put back; where something is wrong still, it waits anew."""
        if self._base_fault(state):
            self._fault_s = now_s
        else:
            self.arm(now_s, state)

    def start_gesture(self, now_s: float, state: BaseState) -> None:
        """Store where and when a gesture begins."""
        self._checked_s, self._slip_rad = now_s, state.sensors.slip_rad
        self._resistance = Resistance()
        self._gestures_started += 1

    def check(
        self,
        now_s: float,
        state: BaseState,
        ordered: Twist,
        *,
        performing: bool,
        tether_m: float = TETHER_M,
    ) -> str:
        """Return the code of what must stop the base now, and latch it; empty where nothing must.

        Parameters
        ----------
        now_s
            The time [s]; to be called some 50 times a second.
        state
            What the base reports.
        ordered
            The order that it should follow now, given how late it answers.
        performing
            Whether a gesture is played, its announcement included, or it drives home.
        tether_m
            How far it may be from home [m].
        """
        elapsed_s = 0.0 if self._checked_s is None else now_s - self._checked_s
        self._checked_s = now_s
        faults = self._faults(now_s, state, ordered, performing, elapsed_s, tether_m)
        found = next(faults, "")
        if self.latch or not (found == BUTTON or self.is_armed):
            return ""
        if found:
            self.latch_fault(found, now_s)
        return found

    def blocking_reason(self, state: BaseState) -> str:
        """Return why no gesture may start now, as a code; empty where one may."""
        sensors, is_real = state.sensors, not self._abilities.simulated
        if self.latch:
            return self.latch
        if reason := self._base_fault(state):
            return reason
        if not self.is_armed:
            return DISARMED
        if sensors.is_charging:
            return CHARGING
        if self._is_battery_low(sensors.battery_v):
            return BATTERY_LOW
        if is_real and not self.is_watched:
            return UNWATCHED
        if not self._abilities.closed_loop and self._gestures_started >= OPEN_LOOP_MAX_GESTURES:
            return PLACE_UNKNOWN
        return ""

    @property
    def share(self) -> float:
        """The share of a gesture's size that the base may perform."""
        return 1.0 if self._abilities.closed_loop else OPEN_LOOP_SHARE

    def rejection_reason(self, gesture: Gesture) -> str:
        """Return why the base cannot perform a gesture safely; empty where it can."""
        is_long = not self._abilities.closed_loop and gesture.min_duration_s() > OPEN_LOOP_MAX_S
        return OPEN_LOOP if is_long else ""

    @staticmethod
    def is_at_home(state: BaseState) -> bool:
        """Whether it stands where gestures begin, as far as wheels and gyro agree about that."""
        pose = state.pose
        is_near = pose.distance_m(HOME) <= AT_HOME_M and pose.turn_rad(HOME) <= AT_HOME_RAD
        return is_near and state.sensors.doubt_rad <= LOST_RAD

    def _base_fault(self, state: BaseState) -> str:
        """Return what keeps the base itself from moving, as a code."""
        sensors = state.sensors
        if sensors.silent_s > BASE_SILENT_S:
            return BASE_SILENT
        if sensors.stop_pressed:
            return BUTTON
        return sensors.refusal or min(sensors.hazards, default="")

    def _faults(
        self,
        now_s: float,
        state: BaseState,
        ordered: Twist,
        performing: bool,
        elapsed_s: float,
        tether_m: float,
    ) -> Iterator[str]:
        """Yield the codes of all faults, the most direct first."""
        if reason := self._base_fault(state):
            yield reason
        if performing and elapsed_s > LAPSED_S:
            yield LAPSED
        if state.pose.distance_m(HOME) > tether_m:
            yield TETHER
        if performing and self._resistance.add(state, ordered, min(elapsed_s, LAPSED_S)):
            yield STALLED
        if performing and abs(state.sensors.slip_rad - self._slip_rad) > SLIP_RAD:
            yield SLIPPED
        battery_v = state.sensors.battery_v
        is_empty = battery_v is not None and battery_v < BATTERY_EMPTY_V
        if self._has_held(BATTERY_EMPTY, is_empty, now_s, EMPTY_S):
            yield BATTERY_EMPTY

    def _has_held(self, code: str, holds: bool, now_s: float, for_s: float) -> bool:
        if not holds:
            self._since.pop(code, None)
            return False
        return now_s - self._since.setdefault(code, now_s) >= for_s

    def _is_battery_low(self, battery_v: float | None) -> bool:
        if battery_v is not None:
            self._battery_was_low = battery_v < (
                BATTERY_WARN_V if self._battery_was_low else BATTERY_LOW_V
            )
        return self._battery_was_low
