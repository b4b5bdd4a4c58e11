"""A board as one page shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from rehab.boards.panels.formatting import PanelRow


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

    @property
    def has_you(self) -> bool:
        """Whether the session or patient at hand is on it."""
        return any(row.you for row in self.rows) or bool(self.total and self.total.mine)
