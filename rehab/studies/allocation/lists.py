"""Lists of allocations that others have drawn, such as a trial office."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass

from rehab.studies.allocation.groups_and_strata import Factor, Group, check_levels, find_group
from rehab.training.measures import InvalidSetting

MAX_ENTRIES = 10_000


@dataclass(frozen=True, slots=True)
class ListEntry:
    """A line of a list: its number within the levels of the factors, and the group."""

    number: int
    levels: tuple[str, ...]
    group: str


def read_list(
    text: str, groups: Sequence[Group], factors: Sequence[Factor]
) -> tuple[ListEntry, ...]:
    """Return the entries of a CSV file, by stratum and number.

    Its columns are `number`, each factor by its name, and `group`: an arm's code, or in a crossover
    the codes in their order with hyphens between them.

    Parameters
    ----------
    text
        The file's text, at most ``MAX_ENTRIES`` lines below its header.
    groups, factors
        What is allocated, and the factors whose levels make the strata.

    Raises
    ------
    InvalidSetting
        For missing columns, unknown groups or levels, numbers that occur twice or are left out, an
        unused group.
    """
    wanted = ["number", *(factor.name for factor in factors), "group"]
    reader = csv.DictReader(text.removeprefix("\ufeff").splitlines(), skipinitialspace=True)
    if missing := [name for name in wanted if name not in (reader.fieldnames or [])]:
        raise InvalidSetting(
            "The list has no column {missing}. Its first line must name: {wanted}.",
            missing=", ".join(missing),
            wanted=", ".join(wanted),
        )
    entries: dict[tuple[tuple[str, ...], int], ListEntry] = {}
    for line, row in enumerate(reader, start=2):
        if line > MAX_ENTRIES + 1:
            raise InvalidSetting("A list has at most {most} lines.", most=MAX_ENTRIES)
        entry = _read_entry({name: (row[name] or "").strip() for name in wanted}, line, factors)
        find_group(groups, entry.group)
        if entries.setdefault((entry.levels, entry.number), entry) is not entry:
            raise InvalidSetting(
                "Line {line}: number {number} stands twice. Give each participant one line.",
                line=line,
                number=entry.number,
            )
    listed = tuple(sorted(entries.values(), key=lambda entry: (entry.levels, entry.number)))
    _check_complete(listed, groups)
    return listed


def _read_entry(row: dict[str, str], line: int, factors: Sequence[Factor]) -> ListEntry:
    if not row["number"].isdecimal() or int(row["number"]) < 1:
        raise InvalidSetting(
            "Line {line}: “{number}” is no number. Count the participants from 1.",
            line=line,
            number=row["number"],
        )
    levels = check_levels(factors, [row[factor.name] for factor in factors])
    return ListEntry(int(row["number"]), levels, row["group"])


def _check_complete(listed: Sequence[ListEntry], groups: Sequence[Group]) -> None:
    """Raise InvalidSetting for gaps in the numbers and for a group that stays empty."""
    expected: dict[tuple[str, ...], int] = {}
    for entry in listed:
        number = expected[entry.levels] = expected.get(entry.levels, 0) + 1
        if entry.number != number:
            raise InvalidSetting(
                "Number {number} is missing from the list{where}. Number its lines without gaps.",
                number=number,
                where=f" ({', '.join(entry.levels)})" if entry.levels else "",
            )
    used = {entry.group for entry in listed}
    for group in groups:
        if group.name not in used:
            raise InvalidSetting(
                "The list puts nobody in group {name}. Add lines with it, or remove the arm.",
                name=group.name,
            )


def group_at(listed: Sequence[ListEntry], levels: Sequence[str], index: int) -> str:
    """Return the name of the group of a stratum's participant.

    Parameters
    ----------
    listed
        All entries of the list, by stratum and number.
    levels
        The stratum's level of each factor.
    index
        Of the participant within the stratum, from 0.

    Raises
    ------
    InvalidSetting
        Where the list has no further line for the stratum.
    """
    here = [entry.group for entry in listed if entry.levels == tuple(levels)]
    if index >= len(here):
        raise InvalidSetting(
            "The list has no further line{where}. Close the study, or ask who drew the list for "
            "more lines and start a new study with them.",
            where=f" ({', '.join(levels)})" if levels else "",
        )
    return here[index]
