"""The panel of own sessions on every scores page: of one feedback type, or of all.

Points rank sessions of one type, hit rates those of all. Sessions that were simulated and those
that a person walked never share a board. Only finished sessions are on one: with judged steps,
which have a hit rate, or imported from the original GARRY, which stored only their points.
"""

from __future__ import annotations

from datetime import datetime
from enum import StrEnum

from django.utils.translation import gettext_lazy as _

from rehab.boards.choices import Aggregation, CountedTypes, Participants, PeriodKind
from rehab.boards.models import Leaderboard
from rehab.boards.panels.panel_rows import BoardPanel, date_rows, format_rows
from rehab.boards.ranking.anonymity import find_visible_own_rows
from rehab.boards.ranking.counted_sessions import read_sessions
from rehab.boards.ranking.periods import period_of
from rehab.boards.ranking.results import own_results
from rehab.boards.ranking.standings import Standings
from rehab.sessions.formatting import clinic_time
from rehab.sessions.models import TrainingSession
from rehab.training.valences import Valence


class Scale(StrEnum):
    """What own sessions are ranked by."""

    POINTS = "points"
    KEPT = "kept"  # points that were not lost, where points can only be lost
    RATE = "rate"

    @property
    def metric(self) -> str:
        """The metric of its boards."""
        return "hit_rate" if self is Scale.RATE else "score"


TITLES = {
    Scale.POINTS: _("Your best scores"),
    Scale.KEPT: _("Points you kept"),
    Scale.RATE: _("Your steps at the goal"),
}


def scale_of(valence: Valence) -> Scale:
    """Return what sessions of one valence are ranked by."""
    if not valence.has_points:
        return Scale.RATE
    return Scale.POINTS if valence.rewards else Scale.KEPT


def make_board(scale: Scale, types: CountedTypes) -> Leaderboard:
    """Return an unsaved board of all own sessions, however short or long ago."""
    return Leaderboard(
        among=Participants.SELF,
        metric=scale.metric,
        aggregation=Aggregation.EACH,
        types=types,
        min_valid_strides=0,
        include_simulated=True,
        period=PeriodKind.ALL,
    )


def make_own_panel(session: TrainingSession, now: datetime) -> BoardPanel:
    """Return the panel of own sessions of this session's type.

    A session whose feedback type was changed while it was walked is of no type: it stands among
    those of all types. The caller has checked that the session may be seen.
    """
    is_mixed = bool(session.changed_to)
    scale = Scale.RATE if is_mixed else scale_of(session.to_plan().valence)
    by_rate = make_board(Scale.RATE, CountedTypes.ALL)
    board = by_rate if is_mixed else make_board(scale, CountedTypes.SAME)
    period = period_of(by_rate, now)
    rows = TrainingSession.everywhere.filter(
        patient=session.patient_id, simulated=session.simulated
    )
    # An imported session has points and no steps.
    by_points = [] if is_mixed else [board]
    sessions = list(read_sessions(by_rate, rows, period, frozenset({"score"}), by_points))
    if any("hit_rate" not in one.values for one in sessions):
        known = TrainingSession.everywhere.filter(patient=session.patient_id)
        imported = set(known.filter(legacy_id__isnull=False).values_list("pk", flat=True))
        sessions = [
            one for one in sessions if "hit_rate" in one.values or one.session_id in imported
        ]
    standings = Standings(own_results(board, sessions, session.valence))
    visible = find_visible_own_rows(standings, standings.find_session(session.pk))
    walked = (
        TrainingSession.everywhere.only("created_at", "started_at", "active_s", "legacy_id")
        .order_by()  # by key; the model's own order would lead through the clinic's other rows
        .in_bulk({each.row.session_id for each in visible})
    )
    local = clinic_time(now, session.clinic)
    title = str(TITLES[scale])
    return BoardPanel(
        slug="all" if is_mixed else "same",
        title=title,
        label=title,
        rows=date_rows(format_rows(board, visible), walked, session, local),
        kept=scale is Scale.KEPT,
    )
