"""Which variant answers a decision: from the pool that the walking asks for, never soon again."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from robot.behavior.window_decider import Decision
from robot.motion.gesture import Gesture
from robot.motion.gesture_variants import POOLS, variants
from robot.wire.cue_limits import VARIED

APART = 4  # of so many answers in a row no two are the same variant
STREAKS = {3: "streak_3", 5: "streak_5"}  # decisions in a row above; and each tenth
LONG_STREAK = 10
COMEBACK = 3  # the first decision above after so many below
# How far below its threshold a mean nearly reached it, and how much more than the last one below
# shows an effort (our choices).
NEAR, GAIN = 0.1, 0.1


class Choice(NamedTuple):
    """A variant, its pool, and the seed that it follows from."""

    gesture: Gesture
    pool: str
    seed: int


def pick(pool: Sequence[Gesture], seed: int, number: int, recent: Sequence[str]) -> Gesture:
    """Return a variant of a pool. The same arguments return the same variant on each computer.

    Parameters
    ----------
    pool
        At least ``APART`` variants.
    seed
        Of the session.
    number
        How many answers there were before this one.
    recent
        Names of the latest answers; the last ``APART - 1`` are not picked again.
    """
    fresh = [one for one in pool if one.name not in recent[-(APART - 1) :]]
    # Only ``random()`` of a seeded generator is the same in each version of Python.
    return fresh[int(random.Random(f"{seed} {number}").random() * len(fresh))]  # noqa: S311


class AnswerChooser:
    """Chooses the variants of one session.

    Parameters
    ----------
    seed
        The same seed, decisions and answers lead to the same variants.
    """

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self._run = 0  # decisions in a row above, or below if negative
        self._pools = {True: "joy", False: "disappointment"}
        self._last_below: float | None = None  # mean of the last decision, if it was below
        self._number = 0
        self._recent: deque[str] = deque(maxlen=APART - 1)

    def observe(self, decision: Decision) -> None:
        """Add a decision, answered or not: the pools of ``VARIED`` follow from all of them."""
        run_before = self._run
        self._run = max(run_before, 0) + 1 if decision.above else min(run_before, 0) - 1
        self._pools[decision.above] = (
            self._pool_above(run_before) if decision.above else self._pool_below(decision)
        )
        self._last_below = None if decision.above else decision.mean

    def choose(self, name: str, decision: Decision, pace: float) -> Choice | None:
        """Return the variant for the decision that was observed last.

        Parameters
        ----------
        name
            A pool, or ``VARIED``.
        decision
            What is answered.
        pace
            The share of the limits at which it is performed at most.

        Returns
        -------
        Choice or None
            None where there is no such pool.
        """
        return self.take(self._pools[decision.above] if name == VARIED else name, pace)

    def take(self, pool: str, pace: float) -> Choice | None:
        """Return the next variant of a pool at a pace; None where there is no such pool."""
        if pool not in POOLS:
            return None
        gesture = pick(variants(pool, pace), self.seed, self._number, tuple(self._recent))
        return Choice(gesture, pool, self.seed)

    def mark_started(self, choice: Choice) -> None:
        """Store that this variant is performed."""
        self._number += 1
        self._recent.append(choice.gesture.name)

    def _pool_above(self, run_before: int) -> str:
        if run_before <= -COMEBACK:
            return "comeback"
        if self._run % LONG_STREAK == 0:
            return "streak_10"
        return STREAKS.get(self._run, "joy")

    def _pool_below(self, decision: Decision) -> str:
        if decision.mean >= decision.threshold - NEAR:
            return "near_miss"
        if self._last_below is not None and decision.mean - self._last_below >= GAIN:
            return "effort"
        return "disappointment"
