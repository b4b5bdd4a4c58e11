"""A board as a patient sees it: the others, all together, or the own sessions and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime

from django.utils.translation import gettext as _
from django.utils.translation import gettext_noop, ngettext

from rehab.boards.building import builder, catch_up
from rehab.boards.choosing import choose
from rehab.boards.figures import Figure, keeps, read_own, standing_on
from rehab.boards.models import Leaderboard
from rehab.boards.rows import Row, date_rows, name_rows, say_figure, share, write
from rehab.boards.standings import Listed, Placed, Standings, Stored
from rehab.people.models import Clinic, Patient
from rehab.sessions.formatting import clinic_time
from rehab.sessions.models import TrainingSession

OWN = gettext_noop("These are your own sessions.")
BUILT = gettext_noop("This board is being built.")


@dataclass(frozen=True)
class Total:
    """What all have reached together. ``bar`` is in percent of the goal, which may be missing."""

    value: str
    goal: str
    bar: int
    people: int
    mine: str


@dataclass(frozen=True)
class Shown:
    """A board on a page. ``note``: what it shows instead of the others; ``shared``: others are on
    it; ``kept``: its points are told as kept, without places. ``facts`` are for whoever builds it.
    """

    slug: str
    title: str
    label: str
    rows: Sequence[Row] = field(default_factory=list)
    total: Total | None = None
    note: str = ""
    kept: bool = False
    shared: bool = False
    facts: str = ""

    @property
    def has_you(self) -> bool:
        """Whether the session or patient at hand stands on it."""
        return any(row.you for row in self.rows) or bool(self.total and self.total.mine)


def boards_at(moment: Leaderboard.Moment, clinic: Clinic) -> list[Leaderboard]:
    """Give the boards that a clinic's tablets show at this moment."""
    boards = Leaderboard.everywhere.filter(active=True, moment=moment).select_related("clinic")
    of_clinic = boards.filter(clinic=clinic)
    return list(of_clinic | boards.filter(clinic=None) if clinic.boards_across else of_clinic)


def show_after(session: TrainingSession, now: datetime) -> list[Shown]:
    """Give the boards that are shown after a session; none in a blinded study."""
    if session.patient.blinded:
        return []
    boards = boards_at(Leaderboard.Moment.AFTER_SESSION, session.clinic)
    return [Viewer(board, now, session.patient, session).show() for board in boards]


def show_waiting(clinic: Clinic, now: datetime) -> list[Shown]:
    """Give the boards that a waiting tablet shows: those on which there are enough patients."""
    boards = boards_at(Leaderboard.Moment.WAITING, clinic)
    shown = [Viewer(board, now).show() for board in boards]
    return [board for board in shown if board.shared]


def count_hidden(standings: Standings, fewest: int) -> int:
    """Count those on a board among whom each is hidden, as soon as there are as few as that.

    Simulated patients hide nobody: they count only where they are alone, as in a clinic that tries
    GARRY.
    """
    people = standings.count_people(fewest)
    return people if 0 < people < fewest else standings.count


@dataclass(frozen=True)
class Viewer:
    """A board in somebody's eyes: a patient's, with or without a session at hand, or anybody's.

    ``made`` are the rows of a board that is not saved as it is here, made of the sessions.
    """

    board: Leaderboard
    now: datetime
    patient: Patient | None = None
    session: TrainingSession | None = None
    made: Sequence[Figure] | None = None

    @property
    def valence(self) -> str:
        """The feedback type of the session at hand."""
        return self.session.valence if self.session else ""

    def show(self) -> Shown:
        """Give the board, or the own sessions and why."""
        board, patient = self.board, self.patient
        if board.is_own:
            return self._show_own("")
        if self.made is None and not self._is_up_to_date():
            return self._show_own(f"{_(BUILT)} {_(OWN)}" if patient else _(BUILT))
        standings = self._standings()
        count = count_hidden(standings, board.min_participants)
        people = ngettext("%(count)d patient on it now.", "%(count)d patients on it now.", count)
        people %= {"count": count}
        if count < board.min_participants:
            fewest = {"fewest": board.min_participants}
            why = _("Under %(fewest)d, all see their own sessions.") % fewest
            few = _("Fewer than %(fewest)d people so far.") % fewest
            return self._show_own(f"{few} {_(OWN)}", f"{people} {why}")
        if patient is not None and not standing_on(board).filter(pk=patient.pk).exists():
            why = _("%(patient)s has not agreed to be on it.") % {"patient": patient.nickname}
            return self._show_own(_(OWN), f"{people} {why}")
        me = standings.find(patient.pk) if patient else None
        if board.display == Leaderboard.Display.TOTAL:
            return self._shown(total=self._total(standings, me), shared=True, facts=people)
        rows = name_rows(board, choose(board, standings, me), patient.pk if patient else None)
        if rows:
            return self._shown(rows=rows, shared=True, facts=people)
        why = _("Outside its first half, own sessions are shown.")
        return self._show_own(_(OWN), f"{people} {why}")

    def _is_up_to_date(self) -> bool:
        if self.board.is_being_built:
            builder.wake()  # whoever was at it may have been stopped
            return False
        return catch_up(self.board, self.now)

    def find_typical(self) -> int | None:
        """Give the patient in the middle of the first half; None for a board of own sessions."""
        if self.board.is_own:
            return None
        standings = self._standings()
        ahead = standings.top((standings.count + 1) // 2)
        return ahead[len(ahead) // 2].patient_id if ahead else None

    def _standings(self) -> Standings:
        key = self.board.list_of(self.valence)
        if self.made is None:
            return Stored(self.board, key)
        return Listed(self.board, (row for row in self.made if row.valence == key))

    def _total(self, standings: Standings, me: Placed | None) -> Total:
        metric, goal = self.board.metric, self.board.total_goal
        return Total(
            value=say_figure(metric, standings.total),
            goal=say_figure(metric, goal) if goal else "",
            bar=share(standings.total, goal) if goal else 0,
            people=standings.count,
            mine=say_figure(metric, me.figure) if me else "",
        )

    def _show_own(self, note: str, facts: str = "") -> Shown:
        """Give the patient's own sessions. Where they add up, their sum; nothing for nobody."""
        board, patient = self.board, self.patient
        if patient is None:
            return self._shown(note=note, facts=facts)
        figures = read_own(board, patient, self.valence, self.now)
        listed = Listed(board, figures)
        if board.entry == Leaderboard.Entry.SUM:
            mine = write(board, choose(self._alone(), listed, None))
            rows = [replace(row, title="", rank=None, you=True) for row in mine]
            return self._shown(rows=rows, note=note, facts=facts)
        me = listed.find_session(self.session.pk) if self.session else None
        rows = write(board, choose(board if board.is_own else self._alone(), listed, me))
        sessions = TrainingSession.everywhere.only("created_at", "started_at", "active_s")
        found = sessions.in_bulk([row.session_id for row in rows])
        now = clinic_time(self.now, patient.clinic)
        dated = date_rows(rows, found, self.session, now)
        return self._shown(rows=dated, note=note, facts=facts)

    def _alone(self) -> Leaderboard:
        """Give the board as it is where a patient is compared with nobody."""
        return Leaderboard(among=Leaderboard.Among.SELF, display=Leaderboard.Display.NEIGHBORS)

    def _shown(
        self,
        *,
        rows: Sequence[Row] = (),
        total: Total | None = None,
        note: str = "",
        shared: bool = False,
        facts: str = "",
    ) -> Shown:
        board = self.board
        valence = self.valence if board.list_of(self.valence) else next(iter(board.slugs), "")
        return Shown(
            slug=f"{board.pk or 'new'}",
            title=board.name,
            label=board.name,
            rows=rows,
            total=total,
            note=note,
            kept=keeps(board.metric, valence),
            shared=shared,
            facts=facts,
        )
