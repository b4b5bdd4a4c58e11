"""A past session in detail: what stands there equals the log."""

from __future__ import annotations

import json
import re
from datetime import UTC, date, datetime, timedelta

import pytest
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.people.roles import Role
from rehab.sessions.formatting import (
    clinic_time,
    format_day,
    format_duration,
    format_number,
    format_rate,
)
from rehab.sessions.log import Remark, RobotEntry, SessionEvent, Step
from rehab.training.changes import Change, ChangeKind
from rehab.training.phases import make_phase
from tests.support.page_text import plain, read_json, words
from tests.support.walks import HIT, MISS, RIGHT, Walked, strides, walk
from tests.support.world import NOW, build_world, client_of

pytestmark = pytest.mark.django_db


@pytest.fixture
def client(world) -> Client:
    return client_of(world, Role.PT)


def detail(client: Client, session) -> str:
    return plain(client.get(reverse("session", kwargs={"session_id": session.pk})).content.decode())


def test_the_chart_holds_every_stride_of_the_trained_leg(client, patient):
    phases = (make_phase("baseline", strides=3), make_phase("training", gain=0.85))
    walked: list[Walked] = [2.1, 1.9, None, 2.4, (RIGHT, 7.0), 2.3]
    walked += [Change(ChangeKind.GOAL, 1.5), 2.3, 99.0]
    session = walk(patient, "positive", walked, phases=phases)
    page = detail(client, session)
    chart = read_json(page, "session")
    needed = "a step needed 1.76–2.35 W/kg for the goal of 1.50–2.00 W/kg."
    assert f"Training: the patient saw 85 % of each value, so {needed}" in words(page)
    stored = list(Step.everywhere.filter(session=session, side="left").order_by("number"))
    columns = chart["strides"]
    assert columns["number"] == [step.number for step in stored] == [1, 2, 3, 4, 6, 7, 8]
    assert columns["hit"] == [step.hit for step in stored]
    # As measured, as the table's means are: what the gain makes harder, it does to the goal.
    assert columns["goal"] == [2, 2, 2, *[round(2 / 0.85, 4)] * 2, *[round(1.5 / 0.85, 4)] * 2]
    assert columns["value"] == [2.1, 1.9, None, 2.4, 2.3, 2.3, None]
    assert columns["why"][2] == "missing"
    assert columns["why"][6] == "out_of_bounds"
    assert [(phase["name"], phase["from"], phase["to"]) for phase in chart["phases"]] == [
        ("Baseline", 1, 3),
        ("Training", 4, 8),
    ]
    assert chart["marks"] == [
        {"after": 6, "kind": "goal", "words": "Goal 2.00 → 1.50\N{NO-BREAK SPACE}W/kg"}
    ]


def test_only_a_type_that_changed_is_pointed_out(client, patient):
    cancelled = [Change(ChangeKind.VALENCE, "binary"), Change(ChangeKind.VALENCE_NOW, "positive")]
    switched = Change(ChangeKind.VALENCE_NOW, "negative")
    phases = (make_phase("training", strides=9), make_phase("training", "Later"))
    session = walk(patient, "positive", [2.3, *cancelled, 2.3, switched, 2.3], phases=phases)
    marks = read_json(detail(client, session), "session")["marks"]
    assert [(mark["after"], mark["kind"]) for mark in marks] == [(1, "valence"), (2, "valence_now")]


def test_pain_and_what_else_happened_is_pointed_out(client, patient):
    session = walk(patient, "positive", [HIT] * 4)
    for kind, value, after in (
        (Remark.BELT_SPEED, 0.7, 1),
        (Remark.REST, None, 3),
        (Remark.PAIN, 3, 2),
        (Remark.FALL, None, 3),
        (Remark.FALL_WITHDRAWN, None, 3),
    ):
        SessionEvent.everywhere.create(
            session=session,
            kind=kind,
            value=value,
            after_number=after,
            at=NOW + timedelta(seconds=after),
        )
    marks = read_json(detail(client, session), "session")["marks"]
    assert [(mark["after"], mark["kind"]) for mark in marks] == [(2, "pain"), (3, "rest")]
    played = words(client.get(reverse("replay", args=[session.pk])).content.decode())
    assert "Pain 3 of 10" in marks[0]["words"]
    assert 'class="badge warn">Pain 3 of 10' in detail(client, session)
    assert played.index("Started") < played.index(marks[0]["words"]) < played.index("Finished")


def test_the_hit_rate_and_the_mean_with_its_change_come_first(client, patient):
    phases = (make_phase("baseline", strides=2), make_phase("training"))
    session = walk(patient, "positive", [2.0, 2.0, 2.2, 2.3], phases=phases)
    told = words(detail(client, session))
    assert "Mean with feedback 2.25 W/kg, +12 % from baseline 2.00" in told
    assert told.index("Hit rate") < told.index("Mean with feedback") < told.index("points")


def test_strides_before_the_goal_is_known_are_drawn_unjudged(client, world, patient):
    from rehab.sessions.live.session.aggregate import SessionAggregate
    from rehab.sessions.services import SessionRequest, create_session
    from rehab.training.goals import GoalRule
    from rehab.training.steps import Measurement, Side
    from tests.support.world import store

    session = create_session(
        SessionRequest(
            patient=patient,
            valence="binary",
            goal=GoalRule(percent_of_baseline=100),
            phases=(make_phase("baseline", strides=60), make_phase("training")),
        )
    )
    aggregate = SessionAggregate(session)
    rows = [*aggregate.change(Change(ChangeKind.START), None, NOW)]
    rows += [aggregate.record_step(Measurement(n, n, Side.LEFT, 2.0), NOW) for n in range(1, 63)]
    store(aggregate, rows)
    columns = read_json(detail(client, session), "session")["strides"]
    assert columns["hit"] == [None] * 60 + [True] * 2
    assert columns["value"] == [2.0] * 62
    assert columns["goal"] == [None] * 60 + [2.0] * 2


def test_phases_and_events_are_told(client, patient):
    phases = (make_phase("baseline", strides=2), make_phase("training"))
    walked: list[Walked] = [
        *(1.0, 3.0, HIT, Change(ChangeKind.GOAL, 2.4), HIT, MISS),
        *(Change(ChangeKind.PAUSE), HIT, Change(ChangeKind.RESUME), MISS),
        Change(ChangeKind.ACTIVATION_THRESHOLD, 0.8),
        Change(ChangeKind.ROBOT_INTENSITY, 0.5),
        *(Change(ChangeKind.GAIN, 0.85), Change(ChangeKind.PHASE, 0), None),
    ]
    session = walk(patient, "positive", walked, phases=phases)
    page = detail(client, session)
    rows = [words(row) for row in re.findall(r"<tr>.*?</tr>", page, re.DOTALL)]
    assert "Baseline none 1.00 3 2 1 50 % 2.00 100 %" in rows
    of_goal = (2.5 / 2.0 + 2.5 / 2.4 + 1.5 / 2.4 + 1.5 / 2.4) / 4
    assert f"Training Positive 1.00 4 4 2 50 % 2.00 {100 * of_goal:.0f} %" in rows
    told = [
        words(item)
        for item in re.findall(r"<li class=\"row wrap \w+\">\s*<time.*?</li>", page, re.DOTALL)
    ]
    assert [line.split(" ", 1)[1] for line in told] == [
        "Started",
        "Goal 2.00 → 2.40 W/kg after stride 3",
        "Paused after stride 5",
        "Resumed after stride 6",
        "Robot threshold 90 % → 80 % after stride 7",
        "Robot normal → gentle after stride 7",
        "Gain 1.00 → 0.85 after stride 7",
        "Phase: Baseline after stride 7",
        "Finished after stride 8",
    ]
    figures = words(re.search(r'<ul class="figures\b[^>]*>.*?</ul>', page, re.DOTALL)[0])
    assert "Hit rate 50 %" in figures
    assert "Score 2 points" in figures
    assert "Goal 2.40 W/kg, changed 1 ×" in figures
    assert "Strides 8 , 2 do not count: not clearly measured" in figures


def test_explicit_feedback_has_no_score(client, patient):
    page = detail(client, walk(patient, "explicit", strides(3, 1)))
    assert "Score – this type has no points" in words(page)


def test_a_robots_gestures_are_counted_and_its_stop_is_listed(client, patient):
    session = walk(patient, "positive", strides(3, 1))
    gesture = [(RobotEntry.GESTURE, {"phase": "started"}), (RobotEntry.GESTURE, {"phase": "ended"})]
    for kind, data in [(RobotEntry.DECISION, {})] * 3 + gesture * 2 + [(RobotEntry.STOP, {})]:
        SessionEvent.everywhere.create(
            session=session, after_number=2, kind=kind.value, at=session.started_at, data=data
        )
    page = words(detail(client, session))
    assert "2 gestures of the robot" in page
    assert "Robot stopped after stride 2" in page
    assert "decision" not in page


@pytest.mark.parametrize(
    ("end", "said", "link"),
    [
        (None, "Running", "monitor"),
        (ChangeKind.ABORT, "Ended early", "scores"),
        (ChangeKind.FINISH, "", "scores"),
    ],
)
def test_every_state_can_be_looked_at(client, patient, end, said, link):
    session = walk(patient, "positive", strides(3, 1), end=end)
    page = detail(client, session)
    assert said in page
    assert reverse(link, kwargs={"session_id": session.pk}) in page


def test_a_session_without_a_stride_says_so(client, patient):
    page = detail(client, walk(patient, "positive", []))
    assert "No strides yet." in page


def test_thousands_of_strides_are_told_by_few_queries(client, patient, django_assert_num_queries):
    session = walk(patient, "binary", strides(2000, 1000))
    url = reverse("session", kwargs={"session_id": session.pk})
    client.get(url)  # what is seen is noted once in some minutes
    with django_assert_num_queries(17):
        page = client.get(url).content.decode()
    assert len(read_json(page, "session")["strides"]["number"]) == 3000
    assert len(page) < 150_000


def test_who_may_look(world, patient):
    record_consent(patient, Purpose.RESEARCH, None, timezone.now())
    session = walk(patient, "positive", strides(3, 1), simulated=True)
    other = build_world("birch")
    past, one = (
        reverse("history", kwargs={"patient_id": patient.pk}),
        reverse("session", kwargs={"session_id": session.pk}),
    )
    for place, role, answers in (
        (world, Role.PT, (200, 200)),
        (world, Role.LEAD, (200, 200)),
        (world, Role.RESEARCHER, (403, 200)),
        (other, Role.PT, (404, 404)),
        (other, Role.RESEARCHER, (403, 404)),
    ):
        client = client_of(place, role)
        assert (client.get(past).status_code, client.get(one).status_code) == answers
    page = detail(client_of(world, Role.RESEARCHER), session)
    assert patient.pseudonym in page
    assert patient.nickname not in page
    assert past not in page
    assert "Simulated" in page
    assert Client().get(one).status_code == 302


# --- words ----------------------------------------------------------------------------------------


def test_figures_are_written_the_same_everywhere():
    rates = [plain(format_rate(rate)) for rate in (0.712, 0, 1, -0.02, None)]
    assert rates == ["71 %", "0 %", "100 %", "−2 %", "–"]
    assert [format_number(value, 0) for value in (1234.4, -5, -0.2)] == ["1,234", "−5", "0"]
    durations = [plain(format_duration(s)) for s in (0, 59.4, 59.6, 1234)]
    assert durations == ["0 s", "59 s", "1 min", "21 min"]


def test_days_follow_the_clinics_own_clock(world):
    late = datetime(2026, 11, 20, 23, 30, tzinfo=UTC)
    world.clinic.time_zone = "Europe/Madrid"
    there = clinic_time(late, world.clinic).date()
    assert there == date(2026, 11, 21)
    assert format_day(there, date(2026, 11, 21)) == "today"
    assert format_day(there, date(2026, 11, 25)) == "21 Nov"
    assert format_day(there, date(2027, 1, 2)) == "21 Nov 2026"


def test_a_change_of_type_and_gain_is_told_wherever_the_session_is(client, patient):
    phases = (make_phase("training", "First"), make_phase("training", "Last"))
    walked: list[Walked] = [
        *(HIT, Change(ChangeKind.GAIN, 0.9), HIT, Change(ChangeKind.VALENCE, "negative")),
        *(Change(ChangeKind.WORDS_SHOWN, 0.0), Change(ChangeKind.CHART_STYLE, "line")),
        *(Change(ChangeKind.PAUSE, "restart"), Change(ChangeKind.RESUME)),
        *(Change(ChangeKind.PHASE, 1.0), MISS),
    ]
    session = walk(patient, "positive", walked, phases=phases)
    page = detail(client, session)
    rows = [words(row) for row in re.findall(r"<tr>.*?</tr>", page, re.DOTALL)]
    for row in ("First Positive 1.00 1", "First Positive 0.90 1", "Last Negative 1.00 1"):
        assert any(found.startswith(row) for found in rows), row
    told = words(page)
    for line in (
        "Positive, changed to Negative",
        "Next feedback type: Negative after stride 2",
        "Words: off after stride 2",
        "Chart: line after stride 2",
        "Paused by a restart of the server after stride 2",
    ):
        assert line in told
    chart = json.loads(re.search(r'<script id="session"[^>]*>(.*?)</script>', page, re.DOTALL)[1])
    assert [phase["name"] for phase in chart["phases"]] == ["First", "Last · Negative"]
    kinds = "gain valence words_shown chart_style pause resume"
    assert {mark["kind"] for mark in chart["marks"]} == set(kinds.split())
    listed = client.get(reverse("history", args=[patient.pk])).content.decode()
    assert "Positive, changed to Negative" in words(listed)
