"""What patients are called where others can see it: a friendly name that says nothing of them."""

from __future__ import annotations

import secrets
from collections.abc import Callable

from django.utils.translation import gettext, gettext_noop

# Everyday words, easy to say and to read after a stroke; none says anything of a body, an age or a
# skin, and no animal is an insult. A translation has as many, in the same order; names are kept in
# English, and each page says them in its language. A manner goes with every animal there.
MANNERS = gettext_noop(
    "Amber, Blue, Brave, Bright, Calm, Cheery, Clever, Coral, Gentle, Golden, Green, Happy, Jolly, "
    "Keen, Kind, Lucky, Merry, Mighty, Noble, Orange, Proud, Purple, Quick, Quiet, Red, Silver, "
    "Sunny, Swift, Warm, Wise"
)
ANIMALS = gettext_noop(
    "Badger, Bear, Beaver, Bee, Bison, Camel, Crab, Crane, Deer, Dolphin, Duck, Eagle, Falcon, "
    "Finch, Fox, Gecko, Goose, Hare, Heron, Horse, Ibis, Jay, Koala, Lark, Lion, Llama, Lynx, "
    "Moose, Newt, Otter, Owl, Panda, Parrot, Pelican, Penguin, Puffin, Rabbit, Raven, Robin, "
    "Salmon, Seal, Sparrow, Squirrel, Stork, Swan, Tiger, Trout, Turtle, Wolf, Wren, Yak, Zebra"
)
TRIES = 20


def draw_alias(is_taken: Callable[[str], bool]) -> str:
    """Draw a name that nobody has; with a number once the plain ones become rare."""
    for attempt in range(TRIES):
        name = f"{secrets.choice(words(MANNERS))} {secrets.choice(words(ANIMALS))}"
        if attempt >= TRIES // 2:
            name += f" {secrets.randbelow(9998) + 2}"
        if not is_taken(name):
            return name
    raise RuntimeError("No free name for boards was found. Try again.")


def say_alias(alias: str) -> str:
    """Give a name as it is said in the language of the page."""
    try:
        manner, animal, *number = alias.split()
        said = {
            "manner": words(gettext(MANNERS))[words(MANNERS).index(manner)],
            "animal": words(gettext(ANIMALS))[words(ANIMALS).index(animal)],
        }
    except ValueError:  # drawn by an older version, from other words
        return alias
    # Translators: of an animal name such as Brave Otter
    return " ".join([gettext("%(manner)s %(animal)s") % said, *number])


def words(text: str) -> list[str]:
    """Give the words of one of the lists."""
    return text.split(", ")
