"""The list of past sessions and its trend: what stands there equals the log."""

from __future__ import annotations

import re
import statistics
from datetime import timedelta

import pytest
from django.test import Client
from django.urls import reverse

from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.log import Step
from rehab.sessions.reports.trend import SESSIONS, load_trend
from rehab.training.changes import ChangeKind
from rehab.training.phases import make_phase
from tests.support.clock import HERE
from tests.support.page_text import plain, read_json, words
from tests.support.walks import GOAL, RIGHT, Walked, strides, walk
from tests.support.world import NOW, client_of

pytestmark = pytest.mark.django_db


@pytest.fixture
def client(world) -> Client:
    return client_of(world, Role.PT)


def history(client: Client, patient: Patient, asked: str = "") -> str:
    url = reverse("history", kwargs={"patient_id": patient.pk})
    return plain(client.get(url + asked).content.decode())


def items(page: str) -> list[str]:
    """Return the words of each session in the list, markup left out."""
    return [words(item) for item in re.findall(r'<a class="item\b.*?</a>', page, re.DOTALL)]


# --- the list -------------------------------------------------------------------------------------


def day_and_time(days_ago: int) -> str:
    """Return how a list tells when a session began, so many days before the test."""
    then = (NOW - timedelta(days=days_ago)).astimezone(HERE.tzinfo)
    year = f" {then.year}" if then.year != HERE.year else ""
    return f"{then.day} {then:%b}{year} {then:%H:%M}"


def test_the_list_tells_type_date_duration_score_hit_rate_and_goal(client, patient):
    walk(patient, "negative", strides(45, 46), days_ago=3)
    walk(patient, "explicit", strides(3, 1), days_ago=2)
    walk(patient, "positive", strides(1, 1), days_ago=1, end=ChangeKind.ABORT)
    walk(patient, "binary", [], end=None, simulated=True)
    listed = items(history(client, patient))
    assert f"{day_and_time(3)}, 2 min Negative · goal 2.00 49 % −46 points" in listed[3]
    assert f"{day_and_time(2)}, 3 s Explicit · goal 2.00 75 % hits" in listed[2]
    assert "ended early" in listed[1]
    assert "– hits" in listed[1]
    assert "running simulated" in listed[0]


def test_chips_count_each_type_and_filter_by_it(client, patient):
    sessions = {v: walk(patient, v, strides(3, 2)) for v in ("positive", "negative", "binary")}
    walk(patient, "positive", strides(4, 2))
    page = history(client, patient)
    chips = words(re.search(r'<nav class="chips\b.*?</nav>', page, re.DOTALL)[0])
    assert chips == "All types 4 Positive 2 Negative 1 Binary 1 Explicit 0"
    page = history(client, patient, "?type=binary")
    assert len(items(page)) == 1
    assert reverse("session", kwargs={"session_id": sessions["binary"].pk}) in page
    assert "No sessions yet" in history(client, patient, "?type=explicit")
    assert len(items(history(client, patient, "?type=nonsense"))) == 4


def test_a_new_patient_has_no_sessions_yet(client, patient):
    assert "The sessions of Rosa will be listed here." in history(client, patient)


def test_many_sessions_come_in_pages_at_the_same_cost(client, patient, django_assert_num_queries):
    for index in range(23):
        walk(patient, "positive", strides(3, 2), days_ago=index)
    url = reverse("history", kwargs={"patient_id": patient.pk})
    client.get(url)  # once a minute it is noted that somebody is there
    with django_assert_num_queries(19):
        first = client.get(url).content.decode()
    with django_assert_num_queries(19):
        second = client.get(f"{url}?page=2").content.decode()
    assert len(items(first)) == 20
    assert len(items(second)) == 3
    assert "1 of 2" in first
    assert len(items(client.get(f"{url}?page=99").content.decode())) == 3


def test_the_trend_equals_the_stored_strides(world, client, patient):
    phases = (
        make_phase("baseline", strides=4),
        make_phase("training", strides=4),
        make_phase("catch", strides=2),
        make_phase("training", "Training 85 %", gain=0.85),
    )
    walked: list[Walked] = [1.0, 1.5, None, 2.0, 3.0, 1.0, (RIGHT, 9.0), 2.5, 2.0]
    walked += [8.0, 8.0, 4.0, 2.2]
    session = walk(patient, "positive", walked, phases=phases, wanted=0.6)
    (point,) = load_trend(world.people[Role.PT], type(session).everywhere.filter(pk=session.pk))
    steps = Step.everywhere.filter(session=session, side="left", valid=True)
    trained = [step.value for step in steps if step.phase in {1, 3}]
    before = [step.value for step in steps if step.phase == 0]
    assert point.with_feedback.count == len(trained) == 6
    assert point.with_feedback.mean == pytest.approx(statistics.mean(trained))
    assert point.with_feedback.deviation == pytest.approx(statistics.pstdev(trained))
    assert point.baseline.mean == pytest.approx(statistics.mean(before)) == 1.5
    assert point.change == pytest.approx(statistics.mean(trained) / 1.5 - 1)
    chart = read_json(history(client, patient), "trend")
    assert chart["hits"]["types"] == chart["values"]["types"] == [session.valence]
    assert chart["hits"]["wanted"] == [60.0]
    judged = [step.hit for step in steps if step.phase in {1, 3}]
    assert chart["hits"]["hit"] == [round(100 * sum(judged) / len(judged), 1)]
    assert chart["values"]["mean"] == [round(statistics.mean(trained), 3)]
    assert chart["values"]["goal"] == [GOAL]
    assert chart["values"]["unit"] == "W/kg"


def test_the_trend_has_the_newest_sessions_oldest_first(world, patient):
    for index in range(SESSIONS + 3):
        walk(patient, "positive", strides(index % 5 + 1, 2), days_ago=index)
    walk(patient, "positive", strides(9, 0), end=ChangeKind.ABORT)
    trend = load_trend(world.people[Role.PT], patient.sessions.all())
    dates = [point.session.created_at for point in trend]
    assert len(trend) == SESSIONS
    assert dates == sorted(dates)
    newest = patient.sessions.filter(state="finished").order_by("-created_at").first()
    assert trend[-1].session == newest


def test_an_imported_session_is_in_the_trend_with_its_points(client, world, patient):
    imported, own = (walk(patient, "positive", strides(3, 1), days_ago=n) for n in (2, 1))
    type(own).everywhere.filter(pk=imported.pk).update(legacy_id=9)
    imported.metrics.exclude(slug="score").delete()
    pt, mine = world.people[Role.PT], patient.sessions.all()
    trend = load_trend(pt, mine, with_imported=True)
    assert [(p.session.pk, p.hit_rate, p.score) for p in trend] == [
        (imported.pk, None, 3),
        (own.pk, 0.75, 3),
    ]
    assert [point.session.pk for point in load_trend(pt, mine)] == [own.pk]
    page = client.get(f"/patients/{patient.pk}/sessions/")
    assert page.context["chart"]["hits"]["hit"] == [None, 75.0]
    assert page.context["chart"]["hits"]["days"][0].endswith("· imported")
    assert page.context["totals"]["hit_rate"] == "75\N{NO-BREAK SPACE}%"


def test_what_was_walked_and_what_was_simulated_share_no_figure(client, patient):
    walk(patient, "positive", strides(9, 0), simulated=True)
    page = history(client, patient)
    assert "Simulated: nobody walked these" in page
    assert read_json(page, "trend")["hits"]["hit"] == [100.0]
    walk(patient, "positive", strides(5, 5))
    page = history(client, patient)
    assert "nobody walked these" not in page
    assert read_json(page, "trend")["hits"]["hit"] == [50.0]
    assert "simulated" in items(page)[1]
    assert "1 session<" in page
