"""The panel of a board for its viewer: rows, a total, or the own sessions and why."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property
from typing import Any

from django.utils.translation import gettext as _
from django.utils.translation import gettext_noop, ngettext

from rehab.boards.cache import read_lists, read_standings
from rehab.boards.choices import Aggregation, DisplayMode, Occasion, Participants
from rehab.boards.models import Leaderboard
from rehab.boards.panels.emptiness import explain_nothing
from rehab.boards.panels.panel_rows import (
    BoardPanel,
    Total,
    date_rows,
    format_figure,
    format_rows,
    name_rows,
    to_percent,
)
from rehab.boards.ranking.anonymity import count_participants, find_visible_rows, has_too_few
from rehab.boards.ranking.counted_sessions import is_kept, read_sessions
from rehab.boards.ranking.eligibility import eligible_patients
from rehab.boards.ranking.periods import period_of
from rehab.boards.ranking.results import own_results
from rehab.boards.ranking.standings import RankedRow, Standings
from rehab.people.models import Clinic, Patient
from rehab.sessions.formatting import clinic_time
from rehab.sessions.models import TrainingSession

OWN_SESSIONS_NOTE = gettext_noop("These are your own sessions.")


def boards_on(occasion: Occasion, clinic: Clinic) -> list[Leaderboard]:
    """Return the boards that a clinic's tablets show on an occasion."""
    boards = Leaderboard.everywhere.filter(active=True, occasion=occasion).select_related("clinic")
    of_clinic = boards.filter(clinic=clinic)
    return list(of_clinic | boards.filter(clinic=None) if clinic.boards_across else of_clinic)


def make_session_panels(session: TrainingSession, now: datetime) -> list[BoardPanel]:
    """Return the boards that are shown after a session; none in a blinded study."""
    if session.patient.blinded:
        return []
    boards = boards_on(Occasion.AFTER_SESSION, session.clinic)
    return [BoardViewer(board, now, session.patient, session).make_panel() for board in boards]


def make_waiting_panels(clinic: Clinic, now: datetime) -> list[BoardPanel]:
    """Return the boards that a waiting tablet shows: those with enough patients."""
    boards = boards_on(Occasion.WAITING, clinic)
    panels = [BoardViewer(board, now).make_panel() for board in boards]
    return [panel for panel in panels if panel.shared]


@dataclass(frozen=True)
class BoardViewer:
    """The viewer of a board: a patient, with or without a session at hand, or anybody.

    The board may be a form that is not saved. ``staff``: a PT looks at it, and not for a patient.
    """

    board: Leaderboard
    now: datetime
    patient: Patient | None = None
    session: TrainingSession | None = None
    staff: bool = False

    @property
    def valence(self) -> str:
        """The valence of the session at hand, or ""; for a PT that of the board's longest list."""
        if self.session is not None:
            return self.session.valence
        return self._longest_list if self.staff else ""

    @cached_property
    def _longest_list(self) -> str:
        lists = read_lists(self.board, self.now)
        return min(lists, key=lambda valence: (-lists[valence].count, valence), default="")

    def make_panel(self) -> BoardPanel:
        """Return the board, or the own sessions and why."""
        board, patient = self.board, self.patient
        if board.is_own:
            return self._own_panel("")
        standings = read_standings(board, self.valence, self.now)
        count = count_participants(board, standings)
        people = ngettext("%(count)d patient on it now.", "%(count)d patients on it now.", count)
        people %= {"count": count}
        if has_too_few(board, standings):
            fewest = {"fewest": board.min_participants}
            why = _("Under %(fewest)d, all see their own sessions.") % fewest
            few = _("Fewer than %(fewest)d people so far.") % fewest
            return self._own_panel(f"{few} {_(OWN_SESSIONS_NOTE)}", f"{people} {why}")
        if patient is not None and not eligible_patients(board).filter(pk=patient.pk).exists():
            why = _("%(patient)s has not agreed to be on it.") % {"patient": patient.nickname}
            return self._own_panel(_(OWN_SESSIONS_NOTE), f"{people} {why}")
        me = standings.find(patient.pk) if patient else None
        if board.display == DisplayMode.TOTAL:
            return self._panel(total=self._total(standings, me), shared=True, summary=people)
        visible = find_visible_rows(board, standings, me, staff=self.staff)
        rows = name_rows(board, visible, patient.pk if patient else None)
        if rows:
            return self._panel(rows=rows, shared=True, summary=people)
        why = _("Outside its first half, own sessions are shown.")
        return self._own_panel(_(OWN_SESSIONS_NOTE), f"{people} {why}")

    def explain_nothing(self) -> str:
        """Return why nobody is on a board of several patients: who agreed, and which settings."""
        patients = eligible_patients(self.board)
        if not patients.exists():
            return _("Nobody has agreed to be on it yet.")
        sessions = TrainingSession.everywhere.filter(patient__in=patients)
        return explain_nothing(self.board, sessions, self.now)

    def find_typical(self) -> int | None:
        """Return the patient in the middle of the first half; None on a board of own sessions."""
        if self.board.is_own:
            return None
        standings = read_standings(self.board, self.valence, self.now)
        ahead = standings.top((standings.count + 1) // 2)
        return ahead[len(ahead) // 2].patient_id if ahead else None

    def _total(self, standings: Standings, me: RankedRow | None) -> Total:
        metric, goal = self.board.metric, self.board.total_goal
        return Total(
            value=format_figure(metric, standings.total),
            goal=format_figure(metric, goal) if goal else "",
            bar=to_percent(standings.total, goal) if goal else 0,
            people=standings.count,
            mine=format_figure(metric, me.figure) if me else "",
        )

    def _own_panel(self, note: str, summary: str = "") -> BoardPanel:
        """Return the patient's own sessions or their sum; without a patient, no rows."""
        board, patient = self.board, self.patient
        if patient is None:
            return self._panel(note=note, summary=summary)
        # A board of several patients shows own sessions as a board of neighbors does.
        neighbors = Leaderboard(among=Participants.SELF, display=DisplayMode.NEIGHBORS)
        period = period_of(board, self.now)
        mine = TrainingSession.everywhere.filter(patient=patient)
        sessions = read_sessions(board, mine, period)
        results = own_results(board, sessions, self.valence)
        standings = Standings(results, board.ties)
        if board.aggregation == Aggregation.SUM:
            own = format_rows(board, find_visible_rows(neighbors, standings, None))
            rows = [replace(row, title="", rank=None, you=True) for row in own]
            return self._panel(rows=rows, note=note, summary=summary)
        me = standings.find_session(self.session.pk) if self.session else None
        shown_as = board if board.is_own else neighbors
        rows = format_rows(board, find_visible_rows(shown_as, standings, me))
        walked = TrainingSession.everywhere.only(
            "created_at", "started_at", "active_s", "legacy_id"
        )
        found = walked.in_bulk([row.session_id for row in rows])
        now = clinic_time(self.now, patient.clinic)
        dated = date_rows(rows, found, self.session, now)
        why = "" if rows else explain_nothing(board, mine, self.now)
        return self._panel(rows=dated, note=note, summary=summary or why, nothing=why)

    def _panel(self, **content: Any) -> BoardPanel:
        """Return the board's panel with the fields of `BoardPanel` that are given."""
        board = self.board
        valence = (
            self.valence if board.list_key(self.valence) else next(iter(board.counted_valences), "")
        )
        kept = is_kept(board.metric, valence)
        return BoardPanel(f"{board.pk or 'new'}", board.name, board.name, kept=kept, **content)
