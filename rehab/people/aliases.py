"""Aliases of patients on boards: friendly names that reveal nothing about them."""

from __future__ import annotations

import secrets
from collections.abc import Callable

from django.utils.translation import gettext, gettext_noop

# Everyday words, easy to say and to read after a stroke; none describes a body, an age or a skin,
# and no animal is an insult. A translation has as many, in the same order, and every manner fits
# every animal: names are stored in English and shown in the language of the page.
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
MAX_DRAWS = 20


def draw_alias(is_taken: Callable[[str], bool]) -> str:
    """Draw a name that is not taken; with a number once the plain ones become rare."""
    for attempt in range(MAX_DRAWS):
        name = f"{secrets.choice(split_list(MANNERS))} {secrets.choice(split_list(ANIMALS))}"
        if attempt >= MAX_DRAWS // 2:
            name += f" {secrets.randbelow(9998) + 2}"
        if not is_taken(name):
            return name
    raise RuntimeError("No free alias was found. Try again.")


def format_alias(alias: str) -> str:
    """Return a name in the language of the page."""
    try:
        manner, animal, *number = alias.split()
        translated = {
            "manner": split_list(gettext(MANNERS))[split_list(MANNERS).index(manner)],
            "animal": split_list(gettext(ANIMALS))[split_list(ANIMALS).index(animal)],
        }
    except ValueError:  # drawn by an older version, from other words
        return alias
    # Translators: of an animal name such as Brave Otter
    return " ".join([gettext("%(manner)s %(animal)s") % translated, *number])


def split_list(text: str) -> list[str]:
    """Return the words of one of the lists."""
    return text.split(", ")
