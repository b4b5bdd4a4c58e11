"""The check of what a patient sees on a screen: letters of three sizes on either side.

It proposes a setting and judges nobody: it is no test of neglect or of eyesight, and a therapist
confirms what it proposes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from rehab.people.models import ScreenSide, ScreenText

SIZES = (ScreenText.NORMAL, ScreenText.LARGE, ScreenText.LARGEST)  # the smallest first
LEFT, RIGHT = "left", "right"
MISSED_MORE = 3  # of six on a side: by so many more than on the other one
HARDLY_ANY = 1  # seen of six


class Letter(NamedTuple):
    """A letter that is shown: which, of which size, on which side."""

    letter: str
    size: str
    side: str


# Each size twice on each side, the sides in no order that can be guessed. Letters that nobody
# takes for another one, and that mean nothing.
LETTERS = tuple(
    Letter(letter, SIZES[size].value, side)
    for letter, size, side in (
        *(("K", 2, RIGHT), ("R", 2, LEFT), ("H", 1, LEFT), ("S", 1, RIGHT)),
        *(("Z", 2, LEFT), ("V", 0, RIGHT), ("N", 1, LEFT), ("D", 2, RIGHT)),
        *(("A", 0, LEFT), ("X", 0, RIGHT), ("E", 1, RIGHT), ("U", 0, LEFT)),
    )
)


class Proposal(NamedTuple):
    """The setting that a check proposes; a side of None: as it is."""

    text: ScreenText
    side: ScreenSide | None


def propose(seen: Sequence[bool]) -> Proposal:
    """Return the setting for what was seen of `LETTERS`, in their order.

    The size is the smallest whose letters, and all larger ones, were seen on the better side. The
    side follows where one side missed three letters more than the other: all goes in the other
    half where hardly any was seen there, else things change places.
    """
    found = [one for one, was_seen in zip(LETTERS, seen, strict=True) if was_seen]
    left = sum(one.side == LEFT for one in found)
    right = len(found) - left
    better = LEFT if left > right else RIGHT
    text = ScreenText.LARGEST
    for size in reversed(SIZES):
        if sum((one.size, one.side) == (size.value, better) for one in found) < 2:
            break
        text = size
    side = None
    if right - left >= MISSED_MORE:
        side = ScreenSide.IN_RIGHT if left <= HARDLY_ANY else ScreenSide.RIGHT
    elif left - right >= MISSED_MORE:
        side = ScreenSide.IN_LEFT if right <= HARDLY_ANY else ScreenSide.LEFT
    return Proposal(text, side)
