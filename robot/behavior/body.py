"""A robot's body: its base, what it feels, and the gesture that it plays until something stops it.

It knows no server and no session. Time is a parameter.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from robot.bases import Answer, BaseState, MobileBase
from robot.behavior.answer_choice import Choice
from robot.behavior.cue import QUIET_PACE
from robot.behavior.expression import Expression
from robot.behavior.manual_drive import ManualDrive
from robot.behavior.safety import ANNOUNCE_S, AWAY, STALLED, Safety
from robot.behavior.status import RobotState, StatusReporter
from robot.motion.base_response import AT_ONCE
from robot.motion.gesture import Gesture
from robot.motion.limits import TETHER_M, Limits
from robot.motion.player import BAD_ODOMETRY, OUT_OF_TIME, Player
from robot.motion.pose import HOME
from robot.motion.twist import STILL

if TYPE_CHECKING:  # it needs the extra `tag`
    from robot.homing.homing import Homing

CANNOT_MOVE = "base_cannot_move"


class Body:
    """One base: starts and stops gestures on it, and is ticked 50 times a second.

    Parameters
    ----------
    base
        An open base; nothing else may order it.
    limits
        Speeds and accelerations of every gesture.
    homing
        Drives it home by its tag; None where it has learned none.

    Attributes
    ----------
    ordered
        The base's present order.
    state
        What the base reported last; before that, home.
    """

    def __init__(self, base: MobileBase, limits: Limits, homing: Homing | None = None) -> None:
        self.base, self.state = base, BaseState(HOME, STILL)
        self.homing = homing
        self._drives_home = False
        self._is_lost = False  # it was on its way home, which is not where odometry began
        # Since the last safety check, so that nothing is lost to another reader in between.
        self._hazards, self._stop_pressed = frozenset[str](), False
        # Without odometry its pose is what was ordered, which is never late.
        response = base.response if base.abilities.closed_loop else AT_ONCE
        self.player = Player(limits, response, is_holonomic=base.abilities.holonomic)
        self.status = StatusReporter(base)
        self.expression = Expression(base)
        self.safety = Safety(base.abilities)
        self.manual_drive = ManualDrive()
        self.ordered = STILL

    @property
    def is_away(self) -> bool:
        """Whether it has to be put back by a person; a simulated one is carried back at once."""
        return not self.base.abilities.simulated and not self._is_at_home(self.state)

    def read(self) -> BaseState:
        """Return the state now, with each hazard since the last safety check. Raises BaseLost.

        Nothing else may read the base: it retains a hazard until it is read, and no longer.
        """
        state = self.base.read()
        self._hazards |= state.sensors.hazards
        self._stop_pressed |= state.sensors.stop_pressed
        sensors = replace(state.sensors, hazards=self._hazards, stop_pressed=self._stop_pressed)
        self.state = replace(state, sensors=sensors)
        return self.state

    def refusal_reason(self, gesture: Gesture, state: BaseState) -> str:
        """Return what keeps it from performing a gesture; empty where it may.

        Parameters
        ----------
        gesture
            At the size that it would be played at.
        state
            What the base reports.
        """
        if not self.base.abilities.moves:
            return CANNOT_MOVE
        if reason := self.safety.rejection_reason(gesture):
            return reason
        if reason := self.safety.blocking_reason(state):
            return reason
        if not self._is_at_home(state):
            if not self.base.abilities.simulated:
                return AWAY
            self.base.set_home()  # as a person would carry it back
        return ""

    def size(self, gesture: Gesture, intensity: float) -> float:
        """Return the share of its size at which a gesture is performed, of a cue's intensity."""
        return round(max(intensity, gesture.least) * self.safety.share, 3)

    def perform(
        self,
        gesture: Gesture,
        intensity: float,
        now_s: float,
        state: BaseState,
        *,
        above: bool | None = None,
        is_quiet: bool = False,
        choice: Choice | None = None,
    ) -> None:
        """Start a gesture that nothing refuses, and answer by it.

        Parameters
        ----------
        gesture
            In full size.
        intensity
            Of the cue, 0 to 1.
        now_s
            The time [s].
        state
            What the base reports.
        above
            Whether it answers a strong window; None where it answers none.
        is_quiet
            Whether without sounds, and slowly.
        choice
            Of what no decision reports.
        """
        sized = gesture.scaled(self.size(gesture, intensity))
        share = round(intensity * self.safety.share, 3)
        after_s = ANNOUNCE_S if self.base.abilities.announces else 0.0
        pose = self.read().pose  # a simulated base may have been put back
        self.player.start(sized, now_s, pose, after_s, QUIET_PACE if is_quiet else 1.0)
        self.expression.start(sized.score.quiet if is_quiet else sized.score, now_s)
        self.safety.start_gesture(now_s, state)
        self.status.report_gesture(sized, "started", "", choice)
        self.base.answer(Answer(gesture.name, above, is_quiet, share))

    def start_alone(self, gesture: Gesture, now_s: float) -> str:
        """Arm it and start a gesture where it stands, or return why not, as a code.

        The caller vouches for a person who watches. No base is carried home first.

        Parameters
        ----------
        gesture
            In full size; an open loop plays half of it.
        now_s
            The time [s].
        """
        safety, state = self.safety, self.read()
        safety.is_watched = True
        reason = (
            safety.rejection_reason(gesture)
            or safety.arm(now_s, state)
            or safety.blocking_reason(state)
        )
        if not reason and not self._is_at_home(state):
            reason = AWAY
        if not reason:
            above = {"glad": True, "sad": False}.get(gesture.score.mood)
            self.perform(gesture, 1.0, now_s, state, above=above)
        return reason

    def tick(self, now_s: float, *, may_be_driven: bool) -> BaseState:
        """Order the base's next twist, and return what it reports. Raises BaseLost.

        Parameters
        ----------
        now_s
            The time [s].
        may_be_driven
            Whether nobody walks, so that a person may drive it to its place by hand.
        """
        state, player = self.read(), self.player
        self._hazards, self._stop_pressed = frozenset(), False
        ordered, tether_m = player.answered(now_s), TETHER_M
        if self._drives_home and self.homing is not None:
            ordered, tether_m = self.homing.answered(now_s), math.inf
        self.expression.tick(now_s)
        performing = player.is_busy or self._drives_home
        found = self.safety.check(now_s, state, ordered, performing=performing, tether_m=tether_m)
        if found:
            self.stop_for(found)
        elif self.safety.may_recover(now_s):
            self.base.set_home()  # as a person would carry it back
            self.safety.recover(now_s, self.read())
        was, driven = player.gesture, self.manual_drive.twist(now_s)
        may_be_driven = may_be_driven and self._can_be_driven(state)
        if self.homing is not None and may_be_driven and self.manual_drive.leads_home(now_s):
            self._drive_home(self.homing, now_s, state)
        elif driven.is_still or not may_be_driven:
            self._end_homing()
            self.ordered = self.base.drive(player.step(now_s, state.pose))
        else:
            self._end_homing()
            self.ordered = self.base.drive(driven)
            self._set_home()  # where it stands is home when the button is let go
        if was is not None and not player.is_busy:
            self.expression.stop()
            self.status.report_gesture(was, "ended", player.outcome)
            if player.outcome in (OUT_OF_TIME, BAD_ODOMETRY):
                # A base that did not get there is held or blocked, and would be again at once.
                self.safety.latch_fault(STALLED, now_s)
                self.stop_for(STALLED)
        return state

    def arm(self, now_s: float) -> None:
        """Let it move again, for a person; where it stands is home now."""
        problem = self.safety.arm(now_s, self.read())
        if problem:
            self.stop_for(problem)
        elif not self.player.is_busy:
            self._set_home()

    def halt(self, reason: str) -> None:
        """Stand still at once."""
        self.manual_drive.end()
        self._end_homing()
        gesture = self.player.gesture
        self.player.halt(reason)
        self.expression.stop()
        self.base.stop()
        self.ordered = STILL
        if gesture is not None:
            self.status.report_gesture(gesture, "ended", self.player.outcome)

    def stop_for(self, reason: str) -> None:
        """Stand still for a fault that is latched, and report it."""
        self.halt(reason)
        self.status.report({"kind": "stop", "reason": reason})

    def state_code(self, there: BaseState, unready: str) -> RobotState:
        """Return its state, and why it would not perform now, as codes.

        Parameters
        ----------
        there
            What the base reports.
        unready
            What else keeps it from performing; empty for nothing.
        """
        reason = self.safety.blocking_reason(there)
        if self.safety.latch:
            return "stopped", reason
        if not self.safety.is_armed:
            return "disarmed", reason
        if self.player.is_busy:
            return "performing", ""
        if self.is_away and not self._drives_home:
            return "away", AWAY
        return "idle", unready or reason

    def show(self, state: RobotState, *, is_quiet: bool) -> None:
        """Show people a state; aloud unless it is quiet, or a gesture without notes is played."""
        gesture = self.player.gesture
        is_silent = gesture is not None and not gesture.score.notes
        self.status.show(state, is_quiet=is_quiet or is_silent)

    def report(self, now_s: float, state: RobotState, there: BaseState, bad_messages: int) -> None:
        """Report the state to the server, where that is due.

        Parameters
        ----------
        now_s
            The time [s].
        state
            As ``state_code`` returned it.
        there
            What the base reports.
        bad_messages
            How many messages broke the protocol.
        """
        self.status.report_status(
            now_s,
            state,
            there,
            gesture=self.player.gesture,
            lights=self.expression.lights,
            bad_messages=bad_messages,
            counters={"refused_arms": self.safety.refused_arms, **self.base.counters},
            homing=None if self.homing is None else self.homing.code,
        )

    def _drive_home(self, homing: Homing, now_s: float, state: BaseState) -> None:
        """Order the next twist on its way home. There, a person has to arm it again."""
        if not self._drives_home or self.ordered.is_still:
            self.safety.start_gesture(now_s, state)  # what is felt, is felt from each stand on
        self._drives_home = True
        self.ordered = self.base.drive(homing.step(now_s, state.pose, state.twist))
        self._is_lost |= not self.ordered.is_still
        if homing.is_home:
            self._end_homing()
            self._set_home()
            self.safety.disarm()

    def _end_homing(self) -> None:
        """End its way home, wherever it is: where odometry begins anew is no home then."""
        if self._drives_home and self.homing is not None:
            self._drives_home = False
            self.homing.end()
            if self._is_lost:
                self.base.set_home()

    def _set_home(self) -> None:
        """Make its place home, because a person or its tag says so."""
        self._is_lost = False
        self.base.set_home()

    def _is_at_home(self, state: BaseState) -> bool:
        """Whether it stands where gestures begin."""
        return not self._is_lost and self.safety.is_at_home(state)

    def _can_be_driven(self, state: BaseState) -> bool:
        """Whether it is armed, real and unhindered."""
        return (
            not self.player.is_busy
            and self.base.abilities.moves
            and not self.base.abilities.simulated  # that is put back by itself
            and self.safety.is_watched
            and not self.safety.blocking_reason(state)
        )
