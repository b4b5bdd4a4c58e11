"""Why a board has no rows: the setting that leaves out every session there is."""

from __future__ import annotations

from copy import copy
from datetime import datetime
from typing import Any

from django.db.models import QuerySet
from django.utils.functional import Promise
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.boards.choices import CountedTypes, PeriodKind
from rehab.boards.models import Leaderboard
from rehab.boards.ranking.counted_sessions import read_sessions
from rehab.boards.ranking.periods import period_of
from rehab.sessions.models import TrainingSession

# Settings that leave sessions out, as they would leave none out; and what they do, in words.
OPEN_SETTINGS: tuple[tuple[dict[str, Any], str | Promise], ...] = (
    ({"include_simulated": True}, _("Simulated walks do not count here.")),
    ({"min_valid_strides": 0}, _("Walks of fewer than %(steps)s steps do not count here.")),
    ({"period": PeriodKind.ALL}, _("Walks from before do not count here.")),
    ({"types": CountedTypes.ALL}, _("Walks with other feedback do not count here.")),
)


def explain_nothing(board: Leaderboard, sessions: QuerySet[TrainingSession], now: datetime) -> str:
    """Return which setting leaves these sessions out; "" where there are none to leave out."""
    if _has_any(board, sessions, now):
        return ""
    alone = [
        str(words) % {"steps": board.min_valid_strides}
        for settings, words in OPEN_SETTINGS
        if _has_any(_with(board, settings), sessions, now)
    ]
    if alone:
        return alone[0]
    everything = {
        name: value for settings, _words in OPEN_SETTINGS for name, value in settings.items()
    }
    if _has_any(_with(board, everything), sessions, now):
        return gettext("Several of its settings leave all walks out.")
    return ""


def _with(board: Leaderboard, settings: dict[str, Any]) -> Leaderboard:
    other = copy(board)
    for name, value in settings.items():
        setattr(other, name, value)
    return other


def _has_any(board: Leaderboard, sessions: QuerySet[TrainingSession], now: datetime) -> bool:
    return any(read_sessions(board, sessions, period_of(board, now)))
