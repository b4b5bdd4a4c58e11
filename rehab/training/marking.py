"""Marks words for translation. Rules know no languages; whoever shows the words translates them."""

from __future__ import annotations


def gettext_noop(text: str) -> str:
    """Give the words back as they are: the name alone tells the translator's tools to take them."""
    return text


class Marked(str):
    """A word that has a translation, as it stands in a sentence."""

    __slots__ = ()


OR = gettext_noop("or")


class AnyOf(tuple[str, ...]):
    """Words with translations of which each would do, as they stand in a sentence."""

    __slots__ = ()

    def __format__(self, spec: str) -> str:
        return f" {OR} ".join(self)
