"""What patients read after a step: pools of phrases, so that words do not wear out.

Each of a band's phrases means the same and is of one length class, so that variety changes nothing
that a study compares. Where a type neither rewards nor takes, its words state: no praise for a miss
or under the negative type, no blame anywhere (docs/reference/scoring.md#bands).
"""

from __future__ import annotations

import hashlib
from functools import lru_cache

from robot.marking import gettext_noop

# By language: the longest phrase, and the longest word in it, that the largest words have room for
# on a tablet (tests/browser/test_word_sizes.py). Of a language that is not here: the last of them.
LENGTHS = {"en": (24, 9), "de": (30, 9), "es": (30, 9), "fr": (30, 9)}
APART = 6  # phrases that come before one may come again, where a pool has at least twice as many


@lru_cache(maxsize=1024)
def _shuffled(seed: int, cycle: int, start: int, end: int) -> tuple[int, ...]:
    """Return the numbers from start to before end in an order that follows from the seed."""

    def rank(index: int) -> bytes:
        return hashlib.sha256(f"{seed}/{cycle}/{index}".encode()).digest()

    return tuple(sorted(range(start, end), key=rank))


def choose_phrase(phrases: tuple[str, ...], seed: int, shown: int) -> str:
    """Return the phrase that comes next, after so many that were shown; "" of none.

    Each half of the pool is shuffled anew in each round, and the halves take turns: so a phrase
    comes again after half of the others at the earliest.
    """
    if not phrases:
        return ""
    size = len(phrases)
    cycle, position = divmod(shown, size)
    half = size // 2
    if position < half:
        return phrases[_shuffled(seed, cycle, 0, half)[position]]
    return phrases[_shuffled(seed, cycle, half, size)[position - half]]


def join(*phrases: str) -> str:
    """Return a pool as a band has it: one phrase a line."""
    return "\n".join(phrases)


ONWARD = join(
    gettext_noop("To the next."),
    gettext_noop("Next up."),
    gettext_noop("Keep going."),
    gettext_noop("Next step."),
    gettext_noop("On we go."),
    gettext_noop("Keep on."),
    gettext_noop("Walk on."),
    gettext_noop("Next one."),
    gettext_noop("Just go on."),
    gettext_noop("Go on."),
    gettext_noop("A new step."),
    gettext_noop("Carry on."),
)

NEAR = join(
    gettext_noop("Nearly there."),
    gettext_noop("Quite near."),
    gettext_noop("Nearly met."),
    gettext_noop("Very near."),
    gettext_noop("In reach."),
    gettext_noop("Goal ahead."),
    gettext_noop("Not far."),
    gettext_noop("Near goal."),
    gettext_noop("So close."),
    gettext_noop("A bit more."),
    gettext_noop("Close now."),
    gettext_noop("So near."),
)

REACHED = join(
    gettext_noop("Goal met!"),
    gettext_noop("Goal!"),
    gettext_noop("At the goal!"),
    gettext_noop("You did it!"),
    gettext_noop("Got there!"),
    gettext_noop("Spot on!"),
    gettext_noop("Well done!"),
    gettext_noop("Nicely done!"),
    gettext_noop("Fine step!"),
    gettext_noop("Yes!"),
    gettext_noop("Made it!"),
    gettext_noop("Good step!"),
)

STRONG = join(
    gettext_noop("Above goal!"),
    gettext_noop("Great one!"),
    gettext_noop("Very good!"),
    gettext_noop("Strong step!"),
    gettext_noop("Super one!"),
    gettext_noop("Nice going!"),
    gettext_noop("Strong one!"),
    gettext_noop("Great going!"),
    gettext_noop("Fine work!"),
    gettext_noop("Great step!"),
    gettext_noop("Over goal!"),
    gettext_noop("So good!"),
)

STRONGEST = join(
    gettext_noop("Truly good!"),
    gettext_noop("Bravo!"),
    gettext_noop("First rate!"),
    gettext_noop("Wow!"),
    gettext_noop("Bold step!"),
    gettext_noop("So great!"),
    gettext_noop("Far above!"),
    gettext_noop("Great stride!"),
    gettext_noop("Well above!"),
    gettext_noop("World class!"),
    gettext_noop("Far over!"),
    gettext_noop("Super step!"),
)

FAR_BELOW = join(
    gettext_noop("Far below."),
    gettext_noop("Not near."),
    gettext_noop("Far under."),
    gettext_noop("Quite far."),
    gettext_noop("Far off."),
    gettext_noop("Far away."),
    gettext_noop("Way below."),
    gettext_noop("Goal is far."),
    gettext_noop("Big gap."),
    gettext_noop("Far short."),
    gettext_noop("Still far."),
    gettext_noop("Far to go."),
)

BELOW = join(
    gettext_noop("Below goal."),
    gettext_noop("Under goal."),
    gettext_noop("Just below."),
    gettext_noop("Bit short."),
    gettext_noop("Just shy."),
    gettext_noop("A bit under."),
    gettext_noop("Just short."),
    gettext_noop("Just under."),
    gettext_noop("A bit below."),
    gettext_noop("Not quite."),
    gettext_noop("Short of it."),
    gettext_noop("Still under."),
)

NOTHING_LOST = join(
    gettext_noop("None lost."),
    gettext_noop("Zero lost."),
    gettext_noop("Points kept."),
    gettext_noop("All kept."),
    gettext_noop("None gone."),
    gettext_noop("No loss."),
    gettext_noop("Points stay."),
    gettext_noop("Points safe."),
    gettext_noop("None taken."),
    gettext_noop("Same score."),
    gettext_noop("Score kept."),
    gettext_noop("Same total."),
)
