"""What a questionnaire is: items, each with a scale, in one language; and what answers come to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from rehab.training.measures import InvalidSetting

MAX_ITEMS, MAX_POINTS, MAX_LETTERS = 40, 21, 300
ENGLISH = "en"


@dataclass(frozen=True, slots=True)
class Item:
    """A question or statement with its scale: from ``first``, so many ``points``, ``step`` apart.

    ``low`` and ``high`` are the words at the scale's ends.

    Raises
    ------
    InvalidSetting
        For a scale that nobody could answer on.
    """

    text: str
    low: str
    high: str
    points: int
    first: int = 1
    step: int = 1

    def __post_init__(self) -> None:
        if not self.text or max(map(len, (self.text, self.low, self.high))) > MAX_LETTERS:
            raise InvalidSetting(
                "A question has 1 to {most} letters, and so have the ends of its scale.",
                most=MAX_LETTERS,
            )
        if not 2 <= self.points <= MAX_POINTS:
            raise InvalidSetting(
                "“{text}” needs a scale of 2 to {most} points.", text=self.text, most=MAX_POINTS
            )

    @property
    def values(self) -> range:
        """What can be answered."""
        return range(self.first, self.first + self.points * self.step, self.step)


class Scoring(StrEnum):
    """How answers are summed up."""

    NONE = "none"
    MEAN = "mean"
    SUS = "sus"


@dataclass(frozen=True, slots=True)
class Instrument:
    """A questionnaire in one language, as it is asked.

    ``source`` and ``license`` are where the items are from and why they may be used;
    ``validated`` says whether this wording was: a translation of our own is not.
    """

    slug: str
    title: str
    intro: str
    language: str
    items: tuple[Item, ...]
    source: str = ""
    license: str = ""
    validated: bool = False
    scoring: Scoring = Scoring.NONE

    def __post_init__(self) -> None:
        if not 1 <= len(self.items) <= MAX_ITEMS:
            raise InvalidSetting("A questionnaire has 1 to {most} questions.", most=MAX_ITEMS)

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data; `from_json` reads it."""
        names = ("slug", "title", "intro", "language", "source", "license", "validated")
        items = [
            {name: getattr(item, name) for name in Item.__slots__}  # in their order
            for item in self.items
        ]
        return {name: getattr(self, name) for name in names} | {
            "items": items,
            "scoring": self.scoring.value,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Instrument:
        """Return what `to_json` wrote. Raises InvalidSetting, KeyError, TypeError, ValueError."""
        items = tuple(Item(**item) for item in data["items"])
        return cls(**{**data, "items": items, "scoring": Scoring(data["scoring"])})

    def check_answer(self, number: int, value: int) -> None:
        """Raise InvalidSetting for a question that it has not, or a value off the scale."""
        if not 0 <= number < len(self.items) or value not in self.items[number].values:
            raise InvalidSetting("That is no answer to this question. Choose one that is shown.")

    def score(self, answers: Sequence[int | None]) -> float | None:
        """Return what the answers come to, from 0 to 100; None where one is missing or none is.

        ``answers``: one for each item, None for a skipped one.
        """
        given = [answer for answer in answers if answer is not None]
        rule = _RULES.get(self.scoring)
        if rule is None or len(given) < len(self.items):
            return None
        return rule(given)


def _mean(answers: Sequence[int]) -> float:
    return sum(answers) / len(answers)


def _sus(answers: Sequence[int]) -> float:
    """Return 2.5 × the sum of (answer − 1) of odd items and (5 − answer) of even ones.

    Source: Brooke 1996 (docs/reference/questionnaires.md#sus).
    """
    return 2.5 * sum(
        answer - 1 if number % 2 == 0 else 5 - answer for number, answer in enumerate(answers)
    )


_RULES: dict[Scoring, Callable[[Sequence[int]], float]] = {
    Scoring.MEAN: _mean,
    Scoring.SUS: _sus,
}


def read_items(text: str) -> tuple[Item, ...]:
    """Return the items of a clinic's own questionnaire: a line each, parts between bars.

    ``How tired are you? | not at all | very | 7``. The number of points may be missing: 7.

    Raises
    ------
    InvalidSetting
        For a line that has no scale, with the line.
    """
    items = []
    for line in filter(str.strip, text.splitlines()):
        parts = [part.strip() for part in line.split("|")]
        points = parts[3] if len(parts) == 4 else "7"
        if not 3 <= len(parts) <= 4 or not (points.isascii() and points.isdecimal()):
            raise InvalidSetting(
                "“{line}” has no scale. Write it as “How tired are you? | not at all | very | 7”.",
                line=line.strip()[:MAX_LETTERS],
            )
        items.append(Item(parts[0], parts[1], parts[2], int(points[:4])))
    return tuple(items)
