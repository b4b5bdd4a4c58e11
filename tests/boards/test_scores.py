"""The scores page: places, what is on a board and what is not, ten thousand sessions."""

from __future__ import annotations

import re
from dataclasses import dataclass

import pytest
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.urls import reverse
from hypothesis import given
from hypothesis import strategies as st

from rehab.boards.choices import CountedTypes
from rehab.boards.models import Leaderboard
from rehab.boards.panels.own_sessions_panel import Scale, make_board, scale_of
from rehab.boards.ranking.anonymity import MAX_OWN, find_visible_own_rows
from rehab.boards.ranking.counted_sessions import CountedSession
from rehab.boards.ranking.results import own_results
from rehab.boards.ranking.standings import Standings
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.log import SessionMetric
from rehab.sessions.models import TrainingSession
from rehab.training.changes import ChangeKind
from rehab.training.phases import make_phase
from rehab.training.valences import VALENCES
from tests.support.walks import HIT, MISS, strides, walk
from tests.support.world import NOW, World, build_world, client_of, signed_in

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]


@dataclass(frozen=True)
class Seen:
    """A row as it stands on the page."""

    session: int
    rank: str | None
    value: str
    you: bool


@pytest.fixture
def world(world: World) -> World:
    Leaderboard.everywhere.all().delete()  # test_who_is_shown.py has those
    return world


@pytest.fixture
def client(world) -> Client:
    return client_of(world)


def url_of(session: TrainingSession) -> str:
    return reverse("scores", kwargs={"session_id": session.pk})


def read(page: str, board: str) -> list[Seen]:
    """Read a board's rows from the page as a patient would."""
    part = page.split(f'id="board-{board}"')[1].split("</section>", maxsplit=1)[0]
    rows = []
    for item in re.findall(r"<li\s+(?:class=\"you\"|data-session).*?</li>", part, re.DOTALL):
        rank = re.search(r'class="rank">(\d+)\.<', item)
        value = re.search(r'class="value">(.*?)</span>', item, re.DOTALL)[1]
        words = re.sub(r"<[^>]+>", "", value).replace("\N{NO-BREAK SPACE}", " ")
        rows.append(
            Seen(
                session=int(re.search(r'data-session="(\d+)"', item)[1]),
                rank=rank[1] if rank else None,
                value=" ".join(words.split()),
                you="You" in item and 'aria-current="true"' in item,
            )
        )
    return rows


def test_points_rank_the_sessions_of_one_type_and_ties_share_a_rank(client, patient):
    sessions = [walk(patient, "positive", strides(hits, 2)) for hits in (3, 9, 5, 9, 5, 1)]
    walk(patient, "binary", strides(50, 0))
    rows = read(client.get(url_of(sessions[4])).content.decode(), "same")
    points = {session.pk: hits for session, hits in zip(sessions, (3, 9, 5, 9, 5, 1), strict=True)}
    assert [row.value for row in rows] == ["9", "9", "5", "5", "3", "1"]
    for row in rows:
        assert row.value == str(points[row.session])
        better = sum(other > points[row.session] for other in points.values())
        assert row.rank == str(better + 1)
        assert row.you == (row.session == sessions[4].pk)


def test_binary_points_may_be_negative(client, patient):
    walk(patient, "binary", strides(9, 2))
    last = walk(patient, "binary", strides(2, 7))
    rows = read(client.get(url_of(last)).content.decode(), "same")
    assert [(row.rank, row.value, row.you) for row in rows] == [
        ("1", "7", False),
        ("2", "−5", True),
    ]


def test_hit_rates_rank_the_sessions_of_all_types_beside_one_of_two(client, patient):
    walked = [("positive", 6, 4), ("negative", 9, 1), ("explicit", 3, 7), ("binary", 12, 8)]
    sessions = {walk(patient, v, strides(h, m)).pk: h / (h + m) for v, h, m in walked}
    last = walk(patient, "positive", strides(5, 5))
    sessions[last.pk] = 0.5
    TrainingSession.everywhere.filter(pk=last.pk).update(changed_to="negative")
    rows = read(client.get(url_of(last)).content.decode(), "all")
    assert [(row.rank, row.value) for row in rows] == [
        ("1", "90 %"),
        ("2", "60 %"),
        ("2", "60 %"),
        ("4", "50 %"),
        ("5", "30 %"),
    ]
    assert all(f"{sessions[row.session]:.0%}" == row.value.replace(" ", "") for row in rows)
    assert [row.session for row in rows if row.you] == [last.pk]


def test_explicit_feedback_ranks_by_hit_rate_and_shows_no_points(client, patient):
    walk(patient, "explicit", strides(8, 2))
    walk(patient, "positive", strides(1, 9))
    last = walk(patient, "explicit", strides(5, 5))
    page = client.get(url_of(last)).content.decode()
    assert [row.value for row in read(page, "same")] == ["80 %", "50 %"]
    assert "points" not in page.lower()


def test_negative_points_are_told_as_kept_without_rank_or_minus(client, patient):
    walk(patient, "negative", strides(288, 12))
    walk(patient, "negative", strides(5, 0))
    last = walk(patient, "negative", strides(70, 30))
    page = client.get(url_of(last)).content.decode()
    rows = read(page, "same")
    assert [row.value for row in rows] == ["kept 288 of 300", "kept 70 of 100", "kept 5 of 5"]
    assert {row.rank for row in rows} == {None}
    assert "−" not in page
    assert [row.you for row in rows] == [False, True, False]


def test_the_page_does_not_name_its_feedback_type(client, patient):
    for valence in VALENCES.values():
        page = client.get(url_of(walk(patient, valence.slug, strides(3, 2)))).content.decode()
        words = re.sub(r"<[^>]+>", " ", page.split("<body")[1])
        assert not any(other.label in words for other in VALENCES.values())


def test_only_finished_sessions_with_judged_steps_are_on_a_board(client, patient):
    good = walk(patient, "positive", strides(3, 2))
    aborted = walk(patient, "positive", strides(9, 0), end=ChangeKind.ABORT)
    SessionMetric.everywhere.create(session=aborted, slug="hit_rate", value=1.0)
    walk(patient, "positive", strides(9, 0), end=None)
    walk(patient, "positive", [HIT, MISS], phases=(make_phase("washout"),))
    walk(patient, "positive", [None, None])
    page = client.get(url_of(good)).content.decode()
    assert [row.session for row in read(page, "same")] == [good.pk]


@pytest.mark.parametrize(
    ("walked", "end"),
    [([HIT, MISS], ChangeKind.ABORT), ([None], ChangeKind.FINISH), ([], ChangeKind.FINISH)],
    ids=["aborted", "nothing valid", "nothing walked"],
)
def test_a_session_without_a_score_says_so_and_shows_the_others(client, patient, walked, end):
    good = walk(patient, "positive", strides(3, 2))
    page = client.get(url_of(walk(patient, "positive", walked, end=end))).content.decode()
    told = " ".join(page.split())
    why = "It ended early." if end is ChangeKind.ABORT else "No step was scored."
    assert f"This walk has no score. {why}" in told
    count = len([one for one in walked if one is not None])
    assert ("steps with your" in told) == bool(count)
    assert re.search(
        rf"You walked [^.]+\. {f'<br>{count} steps with your' if count else '</p>'}", told
    )
    rows = read(page, "same")
    assert [(row.session, row.you) for row in rows] == [(good.pk, False)]


def test_the_first_session_that_ever_ended_without_a_score(client, patient):
    page = client.get(url_of(walk(patient, "negative", [None]))).content.decode()
    assert page.count("No scores yet") == 1


@pytest.mark.parametrize("pause", [[], [ChangeKind.PAUSE]], ids=["running", "paused"])
def test_a_session_that_is_open_leads_to_its_page(client, patient, pause):
    from rehab.training.changes import Change

    session = walk(patient, "positive", [HIT, *map(Change, pause)], end=None)
    answer = client.get(url_of(session))
    assert answer.status_code == 302
    assert answer.url == reverse("walk", kwargs={"session_id": session.pk})


def test_simulated_and_walked_sessions_never_share_a_board(client, patient):
    walked = walk(patient, "positive", strides(3, 2))
    simulated = walk(patient, "positive", strides(90, 0), simulated=True)
    page = client.get(url_of(walked)).content.decode()
    assert [row.session for row in read(page, "same")] == [walked.pk]
    assert "Simulated" not in page
    page = client.get(url_of(simulated)).content.decode()
    assert [row.session for row in read(page, "same")] == [simulated.pk]
    assert "Simulated" in page


def test_only_the_patients_own_sessions_are_shown(world, client, patient):
    last = walk(patient, "positive", strides(3, 2))
    walk(world.patient, "positive", strides(9, 0))
    page = client.get(url_of(last)).content.decode()
    assert [row.session for row in read(page, "same")] == [last.pk]
    assert reverse("patient", kwargs={"patient_id": patient.pk}) in page


def test_nobody_else_opens_it(world, patient):
    session = walk(patient, "positive", strides(3, 2))
    other = build_world("birch")
    for person, status in (
        (world.people[Role.RESEARCHER], 403),
        (other.people[Role.PT], 404),
        (other.people[Role.LEAD], 404),
        (world.people[Role.LEAD], 200),
    ):
        client = signed_in(person)
        assert client.get(url_of(session)).status_code == status
    assert Client().get(url_of(session)).status_code == 302
    assert client.post(url_of(session)).status_code == 405


# --- the rules alone ------------------------------------------------------------------------------


def own_session(pk: int, valence: str = "", cost: int = 1, **values: float) -> CountedSession:
    return CountedSession(pk, 1, valence, False, NOW, NOW.date(), values, cost)


def rank(scale: Scale, sessions: list[CountedSession], **fields: str) -> Standings:
    board = make_board(scale, CountedTypes.ALL)
    vars(board).update(fields)
    return Standings(own_results(board, sessions, ""), board.ties)


@given(st.lists(st.tuples(st.integers(0, 40), st.integers(0, 40)).filter(any), max_size=30))
def test_every_place_is_one_more_than_the_better_ones(walked):
    figures = [
        own_session(
            pk, "positive", hit_rate=hits / (hits + misses), score=hits, steps=hits + misses
        )
        for pk, (hits, misses) in enumerate(walked)
    ]
    lost = [
        own_session(
            pk, "negative", hit_rate=hits / (hits + misses), score=-misses, steps=hits + misses
        )
        for pk, (hits, misses) in enumerate(walked)
    ]
    percent = [round(100 * (hits / (hits + misses))) for hits, misses in walked]
    points = [hits for hits, _ in walked]
    for scale, given_figures, truth in (
        (Scale.RATE, figures, percent),
        (Scale.POINTS, figures, points),
        (Scale.KEPT, lost, points),
    ):
        entries = rank(scale, given_figures).top(len(walked))
        places = rank(scale, given_figures, ties="earlier").top(len(walked))
        assert sorted(entry.session_id for entry in entries) == list(range(len(walked)))
        assert [entry.rank for entry in places] == list(range(1, len(walked) + 1))
        assert [entry.rank for entry in entries] == sorted(entry.rank for entry in entries)
        for entry in entries:
            assert entry.figure == truth[entry.session_id]
            assert entry.rank == 1 + sum(other > entry.figure for other in truth)
            if scale is Scale.KEPT:
                assert entry.points_at_stake == sum(walked[entry.session_id])


def test_what_could_be_lost_follows_the_price_of_a_miss():
    for steps, lost, at_stake in ((300, 36, 900), (50, 0, 150), (10, 30, 30)):
        session = own_session(1, "negative", cost=3, score=-lost, steps=steps)
        assert session.points_at_stake("score") == at_stake
        assert session.figure("score") == at_stake - lost


def test_a_valence_is_ranked_by_what_it_pays():
    ways = {slug: scale_of(valence) for slug, valence in VALENCES.items()}
    assert ways == {
        "positive": Scale.POINTS,
        "negative": Scale.KEPT,
        "binary": Scale.POINTS,
        "explicit": Scale.RATE,
    }


@pytest.mark.parametrize("mine", [0, 5, 12, 40, 190, 199])
def test_a_long_board_keeps_the_best_and_those_around(mine):
    sessions = [own_session(pk, hit_rate=(200 - pk) / 200, score=200 - pk) for pk in range(200)]
    standings = rank(Scale.POINTS, sessions)
    visible = find_visible_own_rows(standings, standings.find_session(mine))
    shown = [each.row.session_id for each in visible]
    assert len(shown) <= MAX_OWN
    assert shown == sorted(set(shown))
    assert set(range(10)) | set(range(max(0, mine - 15), min(200, mine + 16))) == set(shown) | set(
        range(10)
    )


# --- ten thousand sessions ------------------------------------------------------------------------


@pytest.fixture
def crowd(world, patient) -> TrainingSession:
    """A clinic with 10,000 finished sessions of 100 patients; the patient has 100 of them."""
    last = walk(patient, "positive", strides(30, 70))
    others = Patient.everywhere.bulk_create(
        Patient(clinic=world.clinic, code=f"C-{i}", nickname=f"C {i}") for i in range(99)
    )
    walkers = [patient, *others]
    copied = {
        field.attname: getattr(last, field.attname)
        for field in TrainingSession._meta.concrete_fields
        if field.attname not in {"id", "patient_id"}
    }
    made = TrainingSession.everywhere.bulk_create(
        (TrainingSession(**copied, patient=walkers[i % 100]) for i in range(10_000)), 500
    )
    SessionMetric.everywhere.bulk_create(
        (
            SessionMetric(session=session, slug=slug, value=value)
            for i, session in enumerate(made)
            for slug, value in (("score", i % 977), ("hit_rate", (i % 89) / 100))
        ),
        5000,
    )
    return last


@pytest.mark.long
def test_among_ten_thousand_sessions_only_the_patients_rows_are_read(client, crowd):
    url = url_of(crowd)
    client.get(url)
    with CaptureQueriesContext(connection) as asked:
        page = client.get(url).content.decode()
    # browser session, account, session, boards of the clinic, figures, facts of what is shown
    assert len(asked) == 6
    rows = read(page, "same")
    assert len(rows) <= MAX_OWN
    assert [row.session for row in rows if row.you] == [crowd.pk]
    better = TrainingSession.everywhere.filter(
        patient=crowd.patient, metrics__slug="score", metrics__value__gt=30
    ).count()
    assert next(row for row in rows if row.you).rank == str(better + 1)
    if connection.vendor == "sqlite":
        for query in asked.captured_queries[2:]:
            with connection.cursor() as cursor:
                cursor.execute(f"EXPLAIN QUERY PLAN {query['sql']}")
                plan = "; ".join(row[3] for row in cursor.fetchall())
            assert "SCAN" not in plan, plan
            if "rehab_sessionmetric" in query["sql"]:
                assert "(patient_id=?)" in plan
                assert "(session_id=? AND slug=?)" in plan
