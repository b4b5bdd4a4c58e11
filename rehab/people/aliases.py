"""What patients are called where others can see it: a friendly name that says nothing of them."""

from __future__ import annotations

import secrets
from collections.abc import Callable

# Everyday words, easy to say and to read after a stroke; none says anything of a body, an age or a
# skin, and no animal is an insult.
MANNERS = (  # noqa: SIM905 (a word a line says no more)
    "Amber Blue Brave Bright Calm Cheery Clever Coral Gentle Golden Green Happy Jolly Keen Kind "
    "Lucky Merry Mighty Noble Orange Proud Purple Quick Quiet Red Silver Sunny Swift Warm Wise"
).split()
ANIMALS = (  # noqa: SIM905
    "Badger Bear Beaver Bee Bison Camel Crab Crane Deer Dolphin Duck Eagle Falcon Finch Fox Gecko "
    "Goose Hare Heron Horse Ibis Jay Koala Lark Lion Llama Lynx Moose Newt Otter Owl Panda Parrot "
    "Pelican Penguin Puffin Rabbit Raven Robin Salmon Seal Sparrow Squirrel Stork Swan Tiger Trout "
    "Turtle Wolf Wren Yak Zebra"
).split()
TRIES = 20


def draw_alias(is_taken: Callable[[str], bool]) -> str:
    """Draw a name that nobody has; with a number once the plain ones become rare."""
    for attempt in range(TRIES):
        name = f"{secrets.choice(MANNERS)} {secrets.choice(ANIMALS)}"
        if attempt >= TRIES // 2:
            name += f" {secrets.randbelow(9998) + 2}"
        if not is_taken(name):
            return name
    raise RuntimeError("No free name for boards was found. Try again.")
