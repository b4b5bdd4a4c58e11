"""What a robot does with the server's messages. Time is a parameter, so that hours take a second.

It moves only while all of this holds: the server was heard within ``SILENCE_S``, the session runs,
and ``safety`` finds no fault. Anything else ends the gesture; a gesture that was missed is not
played later.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

from robot.bases import Answer, BaseState, MobileBase
from robot.behavior.cue import QUIET_PACE, Cue
from robot.behavior.expression import Expression
from robot.behavior.gesture_library import GestureLibrary
from robot.behavior.placing import Placing
from robot.behavior.reports import Report, decision_report, stop_report
from robot.behavior.safety import ANNOUNCE_S, AWAY, STALLED, STOPPED, Safety
from robot.behavior.senses import Senses
from robot.behavior.status import StatusReporter
from robot.behavior.window_decider import Decision, WindowDecider
from robot.motion.gesture import Gesture
from robot.motion.gestures import GESTURES, ORIGINALS
from robot.motion.limits import DEFAULT_LIMITS, Limits
from robot.motion.player import BAD_ODOMETRY, OUT_OF_TIME, Player
from robot.motion.response import AT_ONCE
from robot.motion.twist import STILL
from robot.wire.frames import BadFrame, read_number
from robot.wire.limits import PERFORMANCE_MAX, TIME_MAX_S

Message = Mapping[str, Any]

# Without a message for this long [s] the base stands still. The server sends a heartbeat every
# 0.25 s, and one may come 0.4 s late; without a server a base should move for at most 0.75 s, and
# the order to stand still takes up to 0.05 s to the wheels.
SILENCE_S = 0.65

# Codes: why a robot does not move, and how a gesture ended; ``safety`` has more.
NO_LINK = "no_link"
NO_SESSION = "no_session"
NOT_RUNNING = "not_running"
CANNOT_MOVE = "base_cannot_move"
REPLACED = "replaced"  # a welcome to another session

SAD = ("droop", "original_negative")  # of the gestures that are played alone


class Performer:
    """One robot: handles messages, decides, moves its base, and has reports to send.

    Parameters
    ----------
    base
        An open base; nothing else may order it.
    limits
        Speeds and accelerations of every gesture.
    gestures
        The gestures that a cue may name.

    Attributes
    ----------
    decision
        The newest decision; None before there was one.
    ordered
        The base's present order.
    bad_messages, last_bad_message
        How many messages broke the protocol, and what was wrong with the last one.
    """

    def __init__(
        self,
        base: MobileBase,
        limits: Limits = DEFAULT_LIMITS,
        gestures: Mapping[str, Gesture] = GESTURES | ORIGINALS,
    ) -> None:
        self.base, self.senses = base, Senses(base)
        # Without odometry its pose is what was ordered, which is never late.
        self.player = Player(limits, base.response if base.abilities.closed_loop else AT_ONCE)
        self.gestures = GestureLibrary(gestures, limits)
        self.decider = WindowDecider(Cue())
        self.status = StatusReporter(base)
        self.expression = Expression(base)
        self.decision: Decision | None = None
        self.ordered = STILL
        self.bad_messages = 0
        self.last_bad_message = ""
        self.safety = Safety(base.abilities)
        self.placing = Placing()
        self._session: int | None = None
        self._is_welcome = False  # on this connection; nothing before it counts
        self._is_running = False
        self._is_alone = False  # plays a gesture without a session
        self._heard_s = 0.0

    @property
    def reports(self) -> deque[Report]:
        """Reports to send, oldest first; the sender pops them from the left."""
        return self.status.reports

    @property
    def session(self) -> int | None:
        """The session of the last welcome."""
        return self._session

    @property
    def is_linked(self) -> bool:
        """Whether the server has sent its welcome on this connection, which is not lost."""
        return self._is_welcome

    @property
    def may_act(self) -> bool:
        """Whether a decision may move a robot, this one or another that acts on its decisions.

        A page of the PT has to be open for that, also where our own base is simulated.
        """
        return (
            self._is_welcome
            and self._is_running
            and self.safety.is_watched
            and self.decider.cue.intensity > 0
            and not self.safety.blocking_reason(self.senses.read())
        )

    def handle(self, message: Message, now_s: float) -> None:
        """Handle a message of the server; one that breaks the protocol is only counted."""
        try:
            self._dispatch(message, now_s)
        except BadFrame as problem:
            self.count_bad_message(str(problem))

    def count_bad_message(self, problem: str) -> None:
        """Count a message that breaks the protocol."""
        self.bad_messages += 1
        self.last_bad_message = problem

    def disconnect(self, reason: str) -> None:
        """Stand still at once: the connection to the server is lost. A real base is disarmed."""
        self._is_welcome = self._is_running = False
        self.status.reset()
        self.safety.disconnect()
        self._halt(reason)
        self.decider.drop_window()

    def play_alone(self, gesture: Gesture, now_s: float) -> str:
        """Arm the base and start a gesture where it stands, without a session.

        The caller vouches for a person who watches. No base is carried home first.

        Parameters
        ----------
        gesture
            What to play; in an open loop at half its size.
        now_s
            The performer's clock [s].

        Returns
        -------
        str
            Why the gesture may not start, as a code; empty where it has started.
        """
        safety, state = self.safety, self.senses.read()
        self._is_alone = safety.is_watched = True
        reason = (
            safety.rejection_reason(gesture)
            or safety.arm(now_s, state)
            or safety.blocking_reason(state)
        )
        if not reason and not safety.is_at_home(state):
            reason = AWAY
        if not reason:
            self._start(gesture.scaled(safety.share), now_s, state)
            self.base.answer(Answer(gesture.name, gesture.name not in SAD))
        self.status.show(("stopped", reason) if reason else ("performing", ""), is_quiet=False)
        return reason

    def tick(self, now_s: float) -> None:
        """Order the base's next twist; to be called 50 times a second. Raises BaseLost."""
        # Without a session it does not move, and the server sends no heartbeat.
        if self._session is not None and self._is_welcome and now_s - self._heard_s > SILENCE_S:
            self.disconnect(NO_LINK)
        state, player = self.senses.judge(), self.player
        ordered = player.answered(now_s)
        self.expression.tick(now_s)
        found = self.safety.check(now_s, state, ordered, performing=player.is_busy)
        if found:
            self._stop_for(found)
        was, placed = player.gesture, self.placing.twist(now_s)
        if placed.is_still or not self._may_be_placed(state):
            self.ordered = self.base.drive(player.step(now_s, state.pose))
        else:
            self.ordered = self.base.drive(placed)
            self.base.set_home()  # where it stands is home when the button is let go
        if was is not None and not player.is_busy:
            self.expression.stop()
            self.status.report_gesture(was, "ended", player.outcome)
            if player.outcome in (OUT_OF_TIME, BAD_ODOMETRY):
                # A base that did not get there is held or blocked, and would be again at once.
                self.safety.latch_fault(STALLED, now_s)
                self._stop_for(STALLED)
        self._report(now_s, state)

    def _dispatch(self, message: Message, now_s: float) -> None:
        kind = message.get("type")
        if kind == "welcome":
            self._handle_welcome(message)
        elif kind == "stop":  # whenever it comes, from whichever connection
            self._handle_stop()
        elif not self._is_welcome:
            return  # left over from a connection that was lost
        self._heard_s = now_s
        match kind:
            case "welcome" | "stop" | "error":
                pass
            case "heartbeat":
                self._handle_watched(message, self.safety.is_watched)
            case "step":
                self._handle_step(message, now_s)
            case "state":
                self._handle_state(message)
            case "cue":
                self._set_cue(Cue.read(message.get("cue")))
            case "arm":
                self._handle_arm(now_s)
            case "drive":
                self.placing.order(message, now_s)
            case _:
                raise BadFrame(
                    "A robot understands welcome, step, state, cue, stop, arm, drive, heartbeat."
                )

    def _handle_welcome(self, message: Message) -> None:
        session = message.get("session")
        if session is None:
            self._is_running = False
        elif isinstance(session, int) and not isinstance(session, bool):
            cue, state = Cue.read(message.get("cue")), message.get("state")
            if not isinstance(state, str) or not isinstance(message.get("stopped", False), bool):
                raise BadFrame("A welcome says in which state the session is.")
            if session != self._session:
                self.decider = WindowDecider(cue)
                self.reports.clear()
            self._set_cue(cue)
            self.decider.drop_window()
            self._is_running = state == "running"
            self._handle_watched(message, False)
            if message.get("stopped", False):
                self._handle_stop()
        else:
            raise BadFrame('"session" is a number, or null.')
        if session != self._session or not self._is_running:
            self.player.stop(REPLACED)
        self._session, self._is_welcome = session, True

    def _set_cue(self, cue: Cue) -> None:
        """Use another cue, with the gestures that came with it."""
        for problem in self.gestures.replace_received(cue.gestures):
            self.count_bad_message(problem)
        self.decider.set_cue(cue)

    def _handle_state(self, message: Message) -> None:
        state = message.get("state")
        if not isinstance(state, str):
            raise BadFrame('"state" is a text.')
        self._is_running = state == "running"
        if not self._is_running:
            self.player.stop(state[:16])
            self.decider.drop_window()

    def _handle_watched(self, message: Message, otherwise: bool) -> None:
        watched = message.get("watched", otherwise)
        if not isinstance(watched, bool):
            raise BadFrame('"watched" is true or false.')
        self.safety.is_watched = watched

    def _may_be_placed(self, state: BaseState) -> bool:
        """Whether a person may drive it to its mark: armed, nothing against it, nobody walks."""
        return (
            self._is_welcome
            and not self._is_running
            and not self.player.is_busy
            and self.base.abilities.moves
            and not self.base.abilities.simulated  # that is put back by itself
            and self.safety.is_watched
            and not self.safety.blocking_reason(state)
        )

    def _halt(self, reason: str) -> None:
        self.placing.end()
        gesture = self.player.gesture
        self.player.halt(reason)
        self.expression.stop()
        self.base.stop()
        self.ordered = STILL
        if gesture is not None:
            self.status.report_gesture(gesture, "ended", self.player.outcome)

    def _handle_stop(self) -> None:
        """Stop for a person, and latch it."""
        self.safety.stop(STOPPED)
        self._halt(STOPPED)

    def _stop_for(self, reason: str) -> None:
        """Stand still for a fault that is latched, and report it."""
        self._halt(reason)
        self.status.report(stop_report(reason))

    def _handle_arm(self, now_s: float) -> None:
        """Let it move again; where it stands is home now."""
        problem = self.safety.arm(now_s, self.senses.read())
        if problem:
            self._stop_for(problem)
        elif not self.player.is_busy:
            self.base.set_home()

    def _handle_step(self, message: Message, now_s: float) -> None:
        time_s = read_number(message, "time_s", -TIME_MAX_S, TIME_MAX_S)
        performance = read_number(message, "performance", -PERFORMANCE_MAX, PERFORMANCE_MAX)
        if not self._is_running:
            return
        decision = self.decider.add(time_s, performance)
        if decision is not None:
            self.decision = decision
            self._respond(decision, now_s)

    def _respond(self, decision: Decision, now_s: float) -> None:
        """Report a decision, and start the gesture that follows from it."""
        state, cue = self.senses.read(), self.decider.cue
        name, share = cue.gesture(decision.above), self.decider.share
        reason = self.decider.blocking_reason(decision, performing=self.player.is_busy)
        gesture = None
        if not reason and name is not None:
            gesture, reason = self.gestures.find(name)
        if gesture is not None:
            reason = self._blocking_reason(gesture, state)
        if reason or gesture is None:
            self.status.report(decision_report(decision, None, None, reason, share))
            return
        # The paper's own gestures replicate it, and are the same every time.
        strength = 1.0 if gesture.name in ORIGINALS else decision.strength
        intensity = round(cue.intensity * strength * self.safety.share, 3)
        self.status.report(decision_report(decision, gesture.name, intensity, "", share))
        self._start(gesture.scaled(intensity), now_s, state, QUIET_PACE if cue.is_quiet else 1.0)
        self.base.answer(Answer(gesture.name, decision.above, cue.is_quiet, intensity))
        self.decider.mark_started(decision)

    def _start(self, gesture: Gesture, now_s: float, state: BaseState, pace: float = 1.0) -> None:
        after_s = ANNOUNCE_S if self.base.abilities.announces else 0.0
        pose = self.senses.read().pose  # a simulated base may have been put back
        self.player.start(gesture, now_s, pose, after_s, pace)
        is_quiet = self.decider.cue.is_quiet
        self.expression.start(gesture.score.quiet if is_quiet else gesture.score, now_s)
        self.safety.start_gesture(now_s, state)
        self.status.report_gesture(gesture, "started", "")

    def _blocking_reason(self, gesture: Gesture, state: BaseState) -> str:
        """Return what keeps the base from performing a gesture; empty where it may."""
        if not self.base.abilities.moves:
            return CANNOT_MOVE
        if reason := self.safety.rejection_reason(gesture):
            return reason
        if reason := self.safety.blocking_reason(state):
            return reason
        if not self.safety.is_at_home(state):
            if not self.base.abilities.simulated:
                return AWAY
            self.base.set_home()  # as a person would carry it back
        return ""

    def _state(self, there: BaseState) -> tuple[str, str]:
        """Return the robot's state, and why it would not perform now, as codes."""
        reason = self.safety.blocking_reason(there)
        if self.safety.latch:
            return "stopped", reason
        if not self.safety.is_armed:
            return "disarmed", reason
        if self.player.is_busy:
            return "performing", ""
        if not self.base.abilities.simulated and not self.safety.is_at_home(there):
            return "away", AWAY  # a simulated one is carried back as it is needed
        if self._session is None and not self._is_alone:
            return "idle", NO_SESSION
        return "idle", reason if self._is_running or self._is_alone else NOT_RUNNING

    def _report(self, now_s: float, there: BaseState) -> None:
        """Show the state to people, and report it to the server."""
        state, player = self._state(there), self.player
        self.status.show(state, is_quiet=self.decider.cue.is_quiet)
        if self._is_welcome:
            counts = {"refused_arms": self.safety.refused_arms, **self.base.counters}
            self.status.report_status(
                now_s,
                state,
                there,
                player.gesture,
                self.expression.lights,
                self.bad_messages,
                counts,
            )
