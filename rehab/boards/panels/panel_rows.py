"""A board as one page shows it: its rows with figures, names and days as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, datetime

from django.utils.translation import gettext

from rehab.boards.choices import NameStyle
from rehab.boards.models import Leaderboard
from rehab.boards.ranking.anonymity import VisibleRow
from rehab.boards.ranking.counted_sessions import PERCENT_METRICS
from rehab.boards.ranking.eligibility import eligible_patients
from rehab.people.aliases import format_alias
from rehab.sessions.formatting import NBSP, format_day, format_duration, format_number
from rehab.sessions.models import TrainingSession
from rehab.training.summary.metrics import METRICS

UNITS = {"%", "min"}  # written beside a figure; others follow from the board's name


@dataclass(frozen=True)
class PanelRow:
    """A row on a page.

    ``bar`` is in percent; ``follows_gap`` says whether rows directly before it are not shown.
    """

    value: str
    bar: int
    title: str = ""
    detail: str = ""
    rank: int | None = None
    points_at_stake: str = ""
    you: bool = False
    follows_gap: bool = False
    session_id: int | None = None


@dataclass(frozen=True)
class Total:
    """What all have reached together. ``bar`` is in percent of the goal; 0 without one."""

    value: str
    goal: str
    bar: int
    people: int
    mine: str


@dataclass(frozen=True)
class BoardPanel:
    """A board on a page.

    Attributes
    ----------
    note
        Why it shows own sessions instead of the board.
    kept
        Whether its points are shown as kept, without ranks.
    shared
        Whether other patients are on it.
    summary
        How many patients are on it and why it looks as it does, for the form that edits it.
    nothing
        Why it has no rows, if that is known.
    """

    slug: str
    title: str
    label: str
    rows: Sequence[PanelRow] = field(default_factory=list)
    total: Total | None = None
    note: str = ""
    kept: bool = False
    shared: bool = False
    summary: str = ""
    nothing: str = ""

    @property
    def has_you(self) -> bool:
        """Whether the session or patient at hand is on it."""
        return any(row.you for row in self.rows) or bool(self.total and self.total.mine)


def format_figure(slug: str, value: int) -> str:
    """Return a metric's figure as boards show it."""
    unit = "%" if slug in PERCENT_METRICS else METRICS[slug].unit
    return format_number(value, 0) + (f"{NBSP}{unit}" if unit in UNITS else "")


def format_rows(board: Leaderboard, visible: Sequence[VisibleRow]) -> list[PanelRow]:
    """Return rows with their figures and ranks, without names or days."""
    full = (
        100 if board.metric in PERCENT_METRICS else max([1, *(each.row.figure for each in visible)])
    )
    rows: list[PanelRow] = []
    for each in visible:
        at_stake = each.row.points_at_stake
        rows.append(
            PanelRow(
                value=format_figure(board.metric, each.row.figure),
                bar=to_percent(each.row.figure, at_stake or full),
                rank=each.row.rank if shows_rank(board, each) else None,
                points_at_stake="" if at_stake is None else format_number(at_stake, 0),
                follows_gap=each.follows_gap,
                session_id=each.row.session_id,
            )
        )
    return rows


def with_example(board: Leaderboard, panel: BoardPanel) -> BoardPanel:
    """Return a panel; one that has nothing to show yet with rows as an example, and why."""
    if panel.rows or panel.total:
        return panel
    shows_ranks = board.show_ranks and not panel.kept
    words = gettext("Session %(n)s") if board.is_own else gettext("Example %(n)s")
    rows = [
        PanelRow(
            value=format_figure(board.metric, figure),
            bar=figure,
            title=words % {"n": n},
            rank=n if shows_ranks else None,
            points_at_stake="100" if panel.kept else "",
            you=n == 2,
        )
        for n, figure in enumerate((90, 75, 60), 1)
    ]
    why = panel.nothing or panel.note or gettext("Walks with a goal appear here.")
    note = gettext("An example. %(why)s") % {"why": why}
    return replace(panel, rows=rows, note=note)


def shows_rank(board: Leaderboard, visible: VisibleRow) -> bool:
    """Return whether a row's rank is shown; it never is for points that can only be lost."""
    return board.show_ranks and visible.has_rank and visible.row.points_at_stake is None


def to_percent(value: int, full: int) -> int:
    """Return a figure's share of the whole, in percent from 0 to 100."""
    return max(0, min(100, round(100 * value / full)))


def name_rows(board: Leaderboard, visible: Sequence[VisibleRow], me: int | None) -> list[PanelRow]:
    """Return rows with the names that their patients have on this board.

    Eligibility is checked here once more: a patient who is not eligible now is never shown.
    """
    eligible = eligible_patients(board).filter(pk__in=[each.row.patient_id for each in visible])
    found = {patient.pk: patient for patient in eligible}
    seen: Counter[str] = Counter()
    named: list[PanelRow] = []
    for each, row in zip(visible, format_rows(board, visible), strict=True):
        patient = found.get(each.row.patient_id)
        if patient is None:
            continue
        if board.names == NameStyle.CODE:
            name = patient.code
        elif board.names == NameStyle.INITIALS:
            name = "".join(f"{word[0].upper()}." for word in patient.nickname.split())
        else:
            name = format_alias(patient.alias) if patient.alias else patient.pseudonym
        seen[name] += 1
        if seen[name] > 1:  # initials may repeat: each row has a name of its own
            name = f"{name} {seen[name]}"
        named.append(replace(row, title=name, you=patient.pk == me, session_id=None))
    return named


def date_rows(
    rows: Iterable[PanelRow],
    sessions: dict[int, TrainingSession],
    at_hand: TrainingSession | None,
    now: datetime,
) -> list[PanelRow]:
    """Return rows of own sessions with the day of each, and how long was walked.

    ``now`` is the clinic's clock.
    """
    rows = list(rows)
    began = {
        pk: (session.started_at or session.created_at).astimezone(now.tzinfo)
        for pk, session in sessions.items()
    }
    a_day: Counter[date] = Counter(began[row.session_id or 0].date() for row in rows)
    dated: list[PanelRow] = []
    for row in rows:
        start = began[row.session_id or 0]
        session = sessions[row.session_id or 0]
        walked = format_duration(session.active_s)
        if session.legacy_id is not None:
            walked = f"{walked} · {gettext('imported')}"
        dated.append(
            replace(
                row,
                title=format_day(start.date(), now.date()).replace(" ", NBSP),
                detail=f"{start:%H:%M} · {walked}" if a_day[start.date()] > 1 else walked,
                you=at_hand is not None and row.session_id == at_hand.pk,
            )
        )
    return dated
