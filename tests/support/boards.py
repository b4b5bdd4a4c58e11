"""Patients, boards and sessions for tests of boards."""

from __future__ import annotations

from django.test import Client
from django.urls import reverse

from rehab.boards.models import Leaderboard
from rehab.boards.panels.viewer import make_session_panels
from rehab.boards.rows import BoardCount, BoardEntry
from rehab.people.models import Clinic, Patient
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Device, Station
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


def everything() -> tuple[list[str], list[tuple[int, str, int, int]]]:
    fields = ("board", "patient", "valence", "figure", "points_at_stake", "key", "stale_on")
    rows = sorted(map(str, BoardEntry.everywhere.values_list(*fields)))
    counts = sorted(BoardCount.everywhere.values_list("board", "valence", "figure", "rows"))
    return rows, counts


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
    tablet = Device(clinic=station.clinic, station=station, kind="tablet", name="T")
    token = tablet.new_token()
    tablet.save()
    return Client(headers={"Authorization": f"Bearer {token}"})
