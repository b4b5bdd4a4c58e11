"""What a robot performs beside answers: greeting, rest and farewell, and idle life."""

from __future__ import annotations

from robot.behavior.answer_choice import AnswerChooser, Choice
from robot.behavior.body import Body
from robot.behavior.cue import Cue
from robot.behavior.idle import IdleLife

# What a message of the session's state may order: pools of ``robot.motion.gesture_variants``.
MOMENTS = ("greeting", "rest", "farewell")


class BesideAnswers:
    """The moments and the idle life of one session. Time is a parameter.

    Parameters
    ----------
    body
        What performs them.
    seed
        Of the session. What answers are chosen does not depend on what is chosen here.
    """

    def __init__(self, body: Body, seed: int) -> None:
        self._body, self._seed = body, seed
        self._chooser, self._idle = AnswerChooser(seed), IdleLife(seed)

    def disturb(self, now_s: float) -> None:
        """Note that something else moves or was decided [s]: no idle motion follows at once."""
        self._idle.disturb(now_s)

    def perform(self, moment: str, cue: Cue, now_s: float) -> None:
        """Perform one of ``MOMENTS``; leave it out where the robot is busy, driven, or refuses.

        Parameters
        ----------
        moment
            The name of its pool.
        cue
            The session's order.
        now_s
            The time [s].
        """
        is_driven = not self._body.manual_drive.twist(now_s).is_still  # somebody stands beside it
        busy = self._body.player.is_busy or is_driven
        choice = None if busy else self._chooser.take(moment, cue.pace)
        if choice is not None and self._start(choice, cue, now_s):
            self._chooser.mark_started(choice)

    def idle(self, cue: Cue, now_s: float, free_s: float, *, may_idle: bool) -> None:
        """Begin an idle motion, if one may begin and no answer can be due before it ends.

        Parameters
        ----------
        cue
            The session's order.
        now_s
            The time [s].
        free_s
            How long no answer can be due [s].
        may_idle
            Whether the order allows it, and a decision could move the robot now.
        """
        can = self._body.base.abilities.closed_loop and self._body.base.abilities.moves
        if not (can and may_idle):
            self._idle.forbid()
            return
        if self._body.player.is_busy:
            self._idle.disturb(now_s)
            return
        gesture = self._idle.next(now_s, free_s, cue.pace)
        if gesture is not None:
            self._start(Choice(gesture, "idle", self._seed), cue, now_s)

    def _start(self, choice: Choice, cue: Cue, now_s: float) -> bool:
        """Start a gesture that answers nothing, and return whether nothing speaks against it."""
        state = self._body.read()
        if self._body.refusal_reason(choice.gesture, state):
            return False
        self._body.perform(
            choice.gesture, cue.intensity, now_s, state, is_quiet=cue.is_quiet, choice=choice
        )
        return True
