"""The ranked results of one list."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Collection, Iterable
from functools import cached_property
from typing import NamedTuple, Self

from rehab.boards.choices import TieRule
from rehab.boards.ranking.results import Key, Result


class RankedRow(NamedTuple):
    """A result and its rank.

    It begins with the fields of `Result`. ``rank`` follows the board's rule for equal figures;
    ``shared_rank`` is the one that equals share under the standard rule.
    """

    patient_id: int
    session_id: int
    valence: str
    figure: int
    points_at_stake: int | None
    key: Key
    shared_rank: int
    rank: int


class Standings:
    """All results of one list, the best first. They are never altered, only copied.

    ``simulated`` are the simulated patients; ``ties`` is the rule for equal figures.
    """

    def __init__(
        self,
        results: Iterable[Result],
        ties: str = TieRule.STANDARD,
        simulated: Collection[int] = (),
    ) -> None:
        self._results = sorted(results, key=lambda result: result.key)
        self._keys = [result.key for result in self._results]
        self._by_patient = {result.patient_id: result for result in self._results}
        self._simulated = frozenset(simulated)
        self._ties = TieRule(ties)

    def replace(
        self, patients: Collection[int], results: Iterable[Result], simulated: Collection[int]
    ) -> Self:
        """Return a copy in which patients have other results; ``simulated`` are those of them."""
        new = object.__new__(type(self))
        new._results, new._keys = self._results.copy(), self._keys.copy()
        new._by_patient, new._ties = self._by_patient.copy(), self._ties
        new._simulated = self._simulated.difference(patients) | frozenset(simulated)
        for patient in patients:
            gone = new._by_patient.pop(patient, None)
            if gone is not None:
                at = bisect_left(new._keys, gone.key)
                del new._keys[at], new._results[at]
        for result in results:
            at = bisect_left(new._keys, result.key)
            new._keys.insert(at, result.key)
            new._results.insert(at, result)
            new._by_patient[result.patient_id] = result
        return new

    @property
    def count(self) -> int:
        """How many results there are."""
        return len(self._results)

    @cached_property
    def people(self) -> int:
        """How many results are those of people, not of simulated patients."""
        return self.count - len(self._simulated & self._by_patient.keys())

    @cached_property
    def total(self) -> int:
        """The sum of all figures."""
        return sum(result.figure for result in self._results)

    @cached_property
    def _merits(self) -> list[int]:
        """The different figures in order, the best first."""
        return sorted({key[0] for key in self._keys})

    def find(self, patient_id: int) -> RankedRow | None:
        """Return a patient's row; None where there is none."""
        result = self._by_patient.get(patient_id)
        return None if result is None else self._rank(result)

    def find_session(self, session_id: int) -> RankedRow | None:
        """Return a session's row in standings of own sessions; None where there is none."""
        found = (result for result in self._results if result.session_id == session_id)
        return next(map(self._rank, found), None)

    def top(self, n: int) -> list[RankedRow]:
        """Return the ``n`` best rows."""
        return [self._rank(result) for result in self._results[:n]]

    def around(self, me: RankedRow, n: int) -> list[RankedRow]:
        """Return a row and ``n`` rows on each side of it."""
        at = bisect_left(self._keys, me.key)
        return [self._rank(result) for result in self._results[max(0, at - n) : at + n + 1]]

    def _rank(self, result: Result) -> RankedRow:
        shared = rank = 1 + bisect_left(self._keys, result.key[:1])
        if self._ties == TieRule.EARLIER:
            rank = 1 + bisect_left(self._keys, result.key)
        elif self._ties == TieRule.DENSE:
            rank = 1 + bisect_left(self._merits, result.key[0])
        return RankedRow(*result, shared, rank)
