"""Patients, boards and sessions for tests of boards."""

from __future__ import annotations

from datetime import datetime

from django.test import Client
from django.urls import reverse

from rehab.boards.cache import clear_cache, read_lists
from rehab.boards.models import Leaderboard
from rehab.boards.panels.shared_panels import make_session_panels
from rehab.boards.ranking.standings import RankedRow, Standings
from rehab.people.models import Clinic, Patient
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Station
from tests.support.tablets import approved
from tests.support.walks import strides, walk
from tests.support.world import NOW, agreeing

COMMON = {"among": "clinic", "aggregation": "best", "min_valid_strides": 1, "period": "all"}


def patient_of(clinic: Clinic, code: str, boards: str = "clinic", **fields) -> Patient:
    patient = Patient.everywhere.create(
        clinic=clinic,
        code=code,
        nickname=f"Nick {code}",
        paretic_side="left",
        boards=boards,
        **fields,
    )
    return agreeing(patient)


def people_of(clinic: Clinic, count: int, **fields) -> list[Patient]:
    return [patient_of(clinic, f"C-{number}", **fields) for number in range(count)]


def board_of(clinic: Clinic | None, **fields) -> Leaderboard:
    board = Leaderboard(clinic=clinic, **{"name": "Board"} | COMMON | fields)
    board.full_clean()
    board.save()
    return board


def walk_down(people: list[Patient], valence: str = "positive", **how) -> list[TrainingSession]:
    """Walk a session of each patient, each with one hit less: 20 of 20, 19 of 20, …"""
    return [walk(one, valence, strides(20 - n, n), **how) for n, one in enumerate(people)]


def see(session: TrainingSession, now=NOW):
    """Return the only board that is shown after a session."""
    (shown,) = make_session_panels(session, now)
    return shown


def told(shown) -> list[tuple[int | None, str, bool]]:
    return [(row.rank, row.value.replace("\N{NO-BREAK SPACE}", ""), row.you) for row in shown.rows]


def figures_of(board: Leaderboard, now: datetime = NOW) -> dict[int, int]:
    """Return the figures on a board with one list, by patient, the best first."""
    stored = Leaderboard.everywhere.select_related("clinic").get(pk=board.pk)
    (rows,) = [*read_lists(stored, now).values()] or [Standings(())]
    return {row.patient_id: row.figure for row in rows.top(rows.count)}


def all_rows(now: datetime = NOW) -> dict[tuple[int, str], list[RankedRow]]:
    """Return the rows of all boards, by board and list."""
    return {
        (board.pk, valence): standings.top(standings.count)
        for board in Leaderboard.everywhere.exclude(among="self").select_related("clinic")
        for valence, standings in read_lists(board, now).items()
        if standings.count
    }


def rows_computed_anew(now: datetime = NOW) -> dict[tuple[int, str], list[RankedRow]]:
    """Return the rows of all boards as another server computes them."""
    clear_cache()
    return all_rows(now)


def page_of(session: TrainingSession, client: Client | None = None) -> str:
    """Return the page of a session's scores, as a tablet shows it."""
    if client is None:
        station, _ = Station.everywhere.get_or_create(clinic=session.clinic, name="One")
        TrainingSession.everywhere.filter(pk=session.pk).update(station=station)
        client = tablet_at(station)
    answer = client.get(reverse("scores", kwargs={"session_id": session.pk}))
    assert answer.status_code == 200
    return answer.content.decode()


def tablet_at(station: Station) -> Client:
    """Return a browser that is a station's tablet."""
    _, token = approved(station)
    return Client(headers={"Authorization": f"Bearer {token}"})
