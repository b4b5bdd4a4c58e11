"""What a clinic's own assessment form asks: numbers in a range, choices, and remarks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rehab.training.measures import InvalidSetting

MAX_ITEMS, MAX_LETTERS, MAX_WORDS, MOST = 60, 200, 20, 1e6
TEXT = "text"

Answer = float | str


@dataclass(frozen=True, slots=True, kw_only=True)
class FormItem:
    """What is asked of the assessor.

    Attributes
    ----------
    text
        The question.
    least, most, places
        Of a number: what can be, with so many decimals.
    usual
        From where to where a number is not asked back; None where any is taken as it is.
    words
        Of a choice: the words of each score, from 0.
    is_text
        Whether it is a remark, which counts nothing.
    """

    text: str
    least: float = 0.0
    most: float = 0.0
    places: int = 0
    usual: tuple[float, float] | None = None
    words: tuple[str, ...] = ()
    is_text: bool = False

    def is_unusual(self, answer: Answer) -> bool:
        """Return whether an answer has to be asked back."""
        if self.usual is None or isinstance(answer, str):
            return False
        return not self.usual[0] <= answer <= self.usual[1]


def total(items: Sequence[FormItem], answers: Sequence[Answer]) -> float:
    """Return the sum of the numbers and choices among answers, rounded as they are given."""
    places = max(item.places for item in items)
    return round(sum(one for one in answers if not isinstance(one, str)), places)


def read_form_items(text: str) -> tuple[FormItem, ...]:
    """Return a form's items: a line each, parts between bars.

    ``Knee bends | 0 | 2`` is a number, with as many decimals as its range is written with;
    ``Knee angle | 0 | 150 | 20 | 120`` is asked back outside of 20 to 120; ``Tone | none, some,
    much`` is a choice that counts 0, 1, 2; ``Shoes | text`` is a remark.

    Raises
    ------
    InvalidSetting
        For a line that is none of them, with the line, and for a form that counts nothing.
    """
    items = tuple(_read_item(line.strip()) for line in text.splitlines() if line.strip())
    if len(items) > MAX_ITEMS or all(item.is_text for item in items):
        raise InvalidSetting(
            "A form has 1 to {most} items, and at least one number or choice: its result is their "
            "sum.",
            most=MAX_ITEMS,
        )
    return items


def _read_item(line: str) -> FormItem:
    words, *parts = (part.strip() for part in line.split("|"))
    if words and len(line) <= MAX_LETTERS:
        if parts == [TEXT]:
            return FormItem(text=words, is_text=True)
        choices = tuple(filter(None, map(str.strip, "".join(parts[:1]).split(","))))
        if len(parts) == 1 and 2 <= len(choices) <= MAX_WORDS:
            return FormItem(text=words, most=len(choices) - 1, words=choices)
        numbers = [_read_number(part) for part in parts]
        if len(numbers) in {2, 4} and None not in numbers:
            least, most, *usual = (number for number in numbers if number is not None)
            low, high = usual or (least, most)
            if least < most and least <= low <= high <= most:
                return FormItem(
                    text=words,
                    least=least,
                    most=most,
                    places=max(len(part.partition(".")[2]) for part in parts),
                    usual=(low, high) if usual else None,
                )
    raise InvalidSetting(
        "“{line}” cannot be read. Write “Knee bends | 0 | 2”, “Knee angle | 0 | 150 | 20 | 120”, "
        "“Tone | none, some, much” or “Shoes | text”.",
        line=line[:MAX_LETTERS],
    )


def _read_number(text: str) -> float | None:
    """Return a decimal number with at most three decimals; None of anything else."""
    whole, _dot, decimals = text.removeprefix("-").partition(".")
    is_number = (whole + (decimals or "0")).isdecimal() and text.isascii() and whole
    if not is_number or len(decimals) > 3 or len(text) > 12:
        return None
    return float(text) if abs(float(text)) <= MOST else None
