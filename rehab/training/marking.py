"""Marks text for translation. Rules know no languages: the pages that show it translate it."""

from __future__ import annotations


def gettext_noop(text: str) -> str:
    """Return the text as it is: only the name matters, by which gettext's tools collect it."""
    return text


class Marked(str):
    """A word with a translation, as part of a sentence."""

    __slots__ = ()


OR = gettext_noop("or")


class AnyOf(tuple[str, ...]):
    """Words with translations, any of which would do, as part of a sentence."""

    __slots__ = ()

    def __format__(self, spec: str) -> str:
        return f" {OR} ".join(self)
