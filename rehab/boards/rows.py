"""Rows of boards in words: figures, names, days."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime

from rehab.boards.choosing import Chosen
from rehab.boards.figures import SHARES, standing_on
from rehab.boards.models import Leaderboard
from rehab.people.aliases import format_alias
from rehab.sessions.formatting import NBSP, format_day, format_duration, format_number
from rehab.sessions.models import TrainingSession
from rehab.training.metrics import METRICS

UNITS = {"%", "min"}  # what is said beside a figure; the board's own name says the others


@dataclass(frozen=True)
class Row:
    """A row on a page. ``bar`` is in percent; ``skips``: rows before it are left out."""

    value: str
    bar: int
    title: str = ""
    detail: str = ""
    rank: int | None = None
    stake: str = ""
    you: bool = False
    skips: bool = False
    session_id: int | None = None


def say_figure(slug: str, value: int) -> str:
    """Write a metric's figure as boards show it."""
    unit = "%" if slug in SHARES else METRICS[slug].unit
    return format_number(value, 0) + (f"{NBSP}{unit}" if unit in UNITS else "")


def write(board: Leaderboard, chosen: Sequence[Chosen]) -> list[Row]:
    """Give rows with their figures, without saying whose they are."""
    full = 100 if board.metric in SHARES else max([1, *(each.row.figure for each in chosen)])
    return [
        Row(
            value=say_figure(board.metric, each.row.figure),
            bar=share(each.row.figure, each.row.stake or full),
            rank=each.row.rank if tells_place(board, each) else None,
            stake="" if each.row.stake is None else format_number(each.row.stake, 0),
            skips=each.skips,
            session_id=each.row.session_id,
        )
        for each in chosen
    ]


def tells_place(board: Leaderboard, chosen: Chosen) -> bool:
    """Whether a row's place is told. Of points that can only be lost it never is."""
    return board.show_ranks and chosen.ranked and chosen.row.stake is None


def share(value: int, full: int) -> int:
    """Give what part of the whole a figure is, in percent from 0 to 100."""
    return max(0, min(100, round(100 * value / full)))


def name_rows(board: Leaderboard, chosen: Sequence[Chosen], me: int | None) -> list[Row]:
    """Give rows with the names that their patients go by on this board.

    Who no longer agrees stands in no row, however the agreement was taken back.
    """
    standing = standing_on(board).filter(pk__in=[each.row.patient_id for each in chosen])
    found = {patient.pk: patient for patient in standing}
    seen: Counter[str] = Counter()
    named: list[Row] = []
    for each, row in zip(chosen, write(board, chosen), strict=True):
        patient = found.get(each.row.patient_id)
        if patient is None:
            continue
        if board.names == Leaderboard.Names.CODE:
            name = patient.code
        elif board.names == Leaderboard.Names.INITIALS:
            name = "".join(f"{word[0].upper()}." for word in patient.nickname.split())
        else:
            name = format_alias(patient.alias) if patient.alias else patient.pseudonym
        seen[name] += 1
        if seen[name] > 1:  # as initials may: each row has a name of its own
            name = f"{name} {seen[name]}"
        named.append(replace(row, title=name, you=patient.pk == me, session_id=None))
    return named


def date_rows(
    rows: Iterable[Row],
    sessions: dict[int, TrainingSession],
    at_hand: TrainingSession | None,
    now: datetime,
) -> list[Row]:
    """Return rows of own sessions with the day of each, and how long was walked.

    ``now`` is the clinic's clock.
    """
    rows = list(rows)
    began = {
        pk: (session.started_at or session.created_at).astimezone(now.tzinfo)
        for pk, session in sessions.items()
    }
    a_day: Counter[date] = Counter(began[row.session_id or 0].date() for row in rows)
    dated: list[Row] = []
    for row in rows:
        start = began[row.session_id or 0]
        walked = format_duration(sessions[row.session_id or 0].active_s)
        dated.append(
            replace(
                row,
                title=format_day(start.date(), now.date()).replace(" ", NBSP),
                detail=f"{start:%H:%M} · {walked}" if a_day[start.date()] > 1 else walked,
                you=at_hand is not None and row.session_id == at_hand.pk,
            )
        )
    return dated
