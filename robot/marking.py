"""Marks text for translation by pages; rules and robots themselves know no languages."""

from __future__ import annotations


def gettext_noop(text: str) -> str:
    """Return the text as it is; gettext's tools collect it by this function's name."""
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


class TranslatableError(ValueError):
    """An error whose message pages translate.

    Parameters
    ----------
    template
        An English sentence with places for values.
    values
        What stands in its places.
    """

    def __init__(self, template: str, /, **values: object) -> None:
        super().__init__(template.format(**values) if values else template)
        self.template, self.values = template, values
