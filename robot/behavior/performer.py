"""What a robot does with the server's messages. Time is a parameter, so that hours take a second.

It moves only while all of this holds: the server was heard lately, the session runs, and
``safety`` finds no fault. Anything else ends the gesture; a gesture that was missed is not played
later, nor one whose steps waited while this program hung.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from robot.bases import MobileBase
from robot.behavior.answer_choice import AnswerChooser
from robot.behavior.beside_answers import MOMENTS, BesideAnswers
from robot.behavior.body import Body
from robot.behavior.cue import Cue
from robot.behavior.gesture_library import GestureLibrary
from robot.behavior.safety import LAPSED_S, STOPPED, is_server_silent
from robot.behavior.status import Report
from robot.behavior.window_decider import Decision, WindowDecider
from robot.motion.gesture import Gesture
from robot.motion.gestures import ORIGINALS
from robot.motion.limits import DEFAULT_LIMITS, Limits
from robot.wire.frames import BadFrame, read_number
from robot.wire.limits import PERFORMANCE_MAX, TIME_MAX_S

if TYPE_CHECKING:  # it needs the extra `tag`
    from robot.homing.homing import Homing

Message = Mapping[str, Any]

# Codes: why a robot does not move, and how a gesture ended; ``safety`` has more.
NO_LINK = "no_link"
NO_SESSION = "no_session"
NOT_RUNNING = "not_running"
REPLACED = "replaced"  # a welcome to another session


class Performer:
    """One robot: handles messages, decides, moves its base, and has reports to send.

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
    decision
        The newest decision; None before there was one.
    body
        Its base with all that moves it and stops it.
    session
        The session of the last welcome; None for none.
    is_linked
        Whether the server has sent its welcome on this connection, which is not lost.
    bad_messages, last_bad_message
        How many messages broke the protocol, and what was wrong with the last one.
    """

    def __init__(
        self,
        base: MobileBase,
        limits: Limits = DEFAULT_LIMITS,
        homing: Homing | None = None,
    ) -> None:
        self.body = Body(base, limits, homing)
        self.gestures = GestureLibrary(limits)
        self.decider = WindowDecider(Cue())
        self.answers, self._beside = AnswerChooser(0), BesideAnswers(self.body, 0)
        self.decision: Decision | None = None
        self.bad_messages = 0
        self.last_bad_message = ""
        self.session: int | None = None
        self.is_linked = False  # nothing before the welcome counts
        self._is_running = False
        self._is_alone = False  # plays a gesture without a session
        self._heard_s = 0.0
        self._step_s = self._stepped_s = 0.0  # the latest step, by the source's clock and by ours
        self._ticked_s = math.inf  # the last tick; there was none
        self._has_hung = False  # so that what is heard may have waited meanwhile

    @property
    def reports(self) -> deque[Report]:
        """Reports to send, oldest first; the sender pops them from the left."""
        return self.body.status.reports

    @property
    def may_act(self) -> bool:
        """Whether a decision may move a robot, this one or another that acts on its decisions.

        A page of the PT has to be open for that, also where our own base is simulated.
        """
        return (
            self.is_linked
            and self._is_running
            and not self._has_hung
            and self.body.safety.is_watched
            and self.decider.cue.moves
            and not self.body.safety.blocking_reason(self.body.read())
        )

    def handle(self, message: Message, now_s: float) -> None:
        """Handle a message of the server; one that breaks the protocol is only counted.

        After a hang of our own, nothing that could begin a motion counts until a tick comes in time
        again: it may have waited in the socket. Stops always count.
        """
        self._has_hung |= now_s - self._ticked_s > LAPSED_S
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
        self.is_linked = self._is_running = False
        self.body.status.reset()
        self.body.safety.disconnect()
        self.body.halt(reason)
        self.decider.drop_window()

    def play_alone(self, gesture: Gesture, now_s: float) -> str:
        """Arm the base and start a gesture without a session, or return why not (``Body``)."""
        self._is_alone = True
        reason = self.body.start_alone(gesture, now_s)
        self.body.status.show(("stopped", reason) if reason else ("performing", ""), is_quiet=False)
        return reason

    def tick(self, now_s: float) -> None:
        """Order the base's next twist; to be called 50 times a second. Raises BaseLost."""
        self._has_hung, self._ticked_s = now_s - self._ticked_s > LAPSED_S, now_s
        # Without a session it does not move, and the server sends no heartbeat.
        if self.session is not None and self.is_linked and is_server_silent(self._heard_s, now_s):
            self.disconnect(NO_LINK)
        free_s = self.decider.free_s(self._step_s + now_s - self._stepped_s)
        may_idle = self.decider.cue.idles and self.may_act
        self._beside.idle(self.decider.cue, now_s, free_s, may_idle=may_idle)
        may_be_driven = self.is_linked and not self._is_running
        there = self.body.tick(now_s, may_be_driven=may_be_driven)
        unready = NO_SESSION if self.session is None else NOT_RUNNING
        if self._is_running or self._is_alone:
            unready = ""
        state = self.body.state_code(there, unready)
        self.body.show(state, is_quiet=self.decider.cue.is_quiet)
        if self.is_linked:
            self.body.report(now_s, state, there, self.bad_messages)

    def _dispatch(self, message: Message, now_s: float) -> None:
        kind = message.get("type")
        if kind == "welcome":
            self._handle_welcome(message)
        elif kind == "stop":  # whenever it comes, from whichever connection
            self._handle_stop()
        elif not self.is_linked:
            return  # left over from a connection that was lost
        self._heard_s = now_s
        match kind:
            case "welcome" | "stop" | "error":
                pass
            case "step" | "arm" | "drive" if self._has_hung:
                self.decider.drop_window()  # a step of it may be missing now
            case "heartbeat":
                self._handle_watched(message, self.body.safety.is_watched)
            case "step":
                self._handle_step(message, now_s)
            case "state":
                self._handle_state(message, now_s)
            case "cue":
                self._set_cue(Cue.read(message.get("cue")))
            case "arm":
                self.body.arm(now_s)
            case "drive":
                self.body.manual_drive.order(message, now_s)
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
            if session != self.session:
                self.decider = WindowDecider(cue)
                seed = session if cue.seed is None else cue.seed
                self.answers, self._beside = AnswerChooser(seed), BesideAnswers(self.body, seed)
                self.reports.clear()
            self._set_cue(cue)
            self.decider.drop_window()
            self._is_running = state == "running"
            self._handle_watched(message, False)
            if message.get("stopped", False):
                self._handle_stop()
        else:
            raise BadFrame('"session" is a number, or null.')
        if session != self.session or not self._is_running:
            self.body.player.stop(REPLACED)
        self.session, self.is_linked = session, True

    def _set_cue(self, cue: Cue) -> None:
        """Use another cue, with the gestures that came with it."""
        for problem in self.gestures.replace_received(cue.gestures):
            self.count_bad_message(problem)
        self.decider.set_cue(cue)

    def _handle_state(self, message: Message, now_s: float) -> None:
        state = message.get("state")
        if not isinstance(state, str):
            raise BadFrame('"state" is a text.')
        pool, runs = message.get("gesture"), state == "running"
        if not runs:
            self.body.player.stop(state[:16])
            self.decider.drop_window()
        # What starts may greet at once; what rests or ends, with its last permission to move.
        self._is_running |= runs
        if pool in MOMENTS and self.may_act:
            self._beside.perform(pool, self.decider.cue, now_s)
        self._is_running = runs
        if pool is not None and pool not in MOMENTS:  # the state counts all the same
            raise BadFrame(f'"gesture" is null, or one of: {", ".join(MOMENTS)}.')

    def _handle_watched(self, message: Message, otherwise: bool) -> None:
        watched = message.get("watched", otherwise)
        if not isinstance(watched, bool):
            raise BadFrame('"watched" is true or false.')
        self.body.safety.is_watched = watched

    def _handle_stop(self) -> None:
        """Stop for a person, and latch it."""
        self.body.safety.stop(STOPPED)
        self.body.halt(STOPPED)

    def _handle_step(self, message: Message, now_s: float) -> None:
        time_s = read_number(message, "time_s", -TIME_MAX_S, TIME_MAX_S)
        performance = read_number(message, "performance", -PERFORMANCE_MAX, PERFORMANCE_MAX)
        if not self._is_running:
            return
        self._step_s, self._stepped_s = time_s, now_s
        decision = self.decider.add(time_s, performance)
        if decision is not None:
            self._beside.disturb(now_s)
            self.decision = decision
            self._respond(decision, now_s)

    def _respond(self, decision: Decision, now_s: float) -> None:
        """Report a decision, and start the gesture that follows from it."""
        state, cue = self.body.read(), self.decider.cue
        self.answers.observe(decision)
        name, share = cue.gesture(decision.above), self.decider.share
        reason = self.decider.blocking_reason(decision, performing=self.body.player.is_busy)
        gesture = choice = None
        if not reason and name is not None:
            choice = self.answers.choose(name, decision, cue.pace)
            gesture, reason = (choice.gesture, "") if choice else self.gestures.find(name)
        if gesture is not None:
            reason = self.body.refusal_reason(gesture, state)
        if reason or gesture is None:
            self.body.status.report_decision(decision, share, reason=reason)
            return
        # The paper's own gestures replicate it, and are the same every time.
        strength = 1.0 if gesture.name in ORIGINALS else decision.strength
        intensity = cue.intensity * strength
        size = self.body.size(gesture, intensity)
        self.body.status.report_decision(decision, share, gesture.name, size, choice=choice)
        self.body.perform(
            gesture, intensity, now_s, state, above=decision.above, is_quiet=cue.is_quiet
        )
        self.decider.mark_started(decision)
        if choice is not None:
            self.answers.mark_started(choice)
