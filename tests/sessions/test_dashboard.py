"""The admin's front page: its figures equal what was walked, and each role sees its own part."""

from __future__ import annotations

import json
import re
from datetime import datetime, timedelta
from types import SimpleNamespace
from zoneinfo import ZoneInfo

import pytest
from django.urls import reverse
from django.utils import timezone

from rehab.people import server_status
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.sessions.formatting import format_duration
from rehab.sessions.live import runtime
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.day import dashboard
from rehab.sessions.reports.day.dashboard import dashboard_context, find_alerts, sessions_today
from rehab.sessions.reports.day.week import week_summary
from rehab.stations.models import Device, Station
from rehab.stations.presence import format_last_seen
from rehab.training.changes import ChangeKind, State
from rehab.training.fold.tallies import Tally
from tests.support.marks import mark
from tests.support.walks import RIGHT, make_patient, strides, walk
from tests.support.world import World, build_world, client_of, signed_in

pytestmark = pytest.mark.django_db

# A Wednesday, ten in the morning in Madrid.
HERE = ZoneInfo("Europe/Madrid")
NOW = datetime(2026, 9, 16, 10, 0, tzinfo=HERE)


@pytest.fixture
def world(world: World) -> World:
    """A clinic in Madrid whose own session lies long ago."""
    Clinic.everywhere.filter(pk=world.clinic.pk).update(time_zone="Europe/Madrid")
    TrainingSession.everywhere.all().update(
        created_at=NOW - timedelta(days=90), started_at=NOW - timedelta(days=90)
    )
    world.clinic.refresh_from_db()
    for user in world.people.values():
        user.clinic.refresh_from_db()
    return world


@pytest.fixture
def rosa(world: World) -> Patient:
    return make_patient(world.clinic, code="K-1")


def ago(patient: Patient, valence: str, walked, moment: datetime, **how) -> TrainingSession:
    """Store a walk that began at a moment."""
    return walk(patient, valence, walked, now=moment, **how)


# --- this week ----------------------------------------------------------------------------------


def test_the_weeks_figures_are_those_of_what_was_walked(world, rosa):
    monday = datetime(2026, 9, 14, 8, 0, tzinfo=HERE)
    # 8 of 10 (wanted 60 %) and a stride of the other leg; 10 of 30 without a wish; 5 of 10 (80 %)
    ago(rosa, "positive", [*strides(8, 2), (RIGHT, 2.5)], monday, wanted=0.6)
    ago(rosa, "positive", [*strides(10, 20), None], monday + timedelta(days=1))
    ago(rosa, "binary", strides(5, 5), NOW - timedelta(hours=1), wanted=0.8)
    # Not of this week, of a person, or of the figures:
    ago(rosa, "positive", strides(9, 0), datetime(2026, 9, 13, 23, 59, tzinfo=HERE))
    ago(rosa, "negative", strides(9, 0), monday, simulated=True)
    out = ago(rosa, "negative", strides(9, 0), monday)
    TrainingSession.everywhere.filter(pk=out.pk).update(excluded=True)
    week = week_summary(world.people[Role.PT], world.clinic, NOW)
    assert (week.total.sessions, week.total.strides, week.excluded) == (3, 50, 2)
    assert week.total.hit_rate == pytest.approx((8 + 10 + 5) / 50)
    assert week.total.target_hit_rate == pytest.approx((0.6 * 10 + 0.8 * 10) / 20)
    positive, binary = week.types
    assert (positive.label, positive.sessions, positive.strides) == ("Positive", 2, 40)
    assert positive.hit_rate == pytest.approx(18 / 40)
    assert positive.target_hit_rate == pytest.approx(0.6)
    assert binary.hit_rate == pytest.approx(0.5)
    assert binary.target_hit_rate == pytest.approx(0.8)
    rows = TrainingSession.everywhere.filter(started_at__gte=monday, excluded=False)
    walked = sum(row.active_s for row in rows if not row.simulated)
    assert week.total.minutes == pytest.approx(walked / 60)
    assert sum(week.minutes) == pytest.approx(walked / 60)
    assert [minutes > 0 for minutes in week.minutes] == [True, True, True, *[False] * 4]
    assert not week.simulated


def test_the_week_begins_on_monday_by_the_clinics_clock(world, rosa):
    # Sunday 22:30 in UTC is Monday in Madrid.
    ago(rosa, "positive", strides(3, 1), datetime(2026, 9, 13, 22, 30, tzinfo=ZoneInfo("UTC")))
    week = week_summary(world.people[Role.PT], world.clinic, NOW)
    assert week.total.sessions == 1
    assert week.minutes[0] > 0


def test_where_nobody_walked_the_simulated_ones_are_told_as_such(world, rosa):
    ago(rosa, "positive", strides(3, 1), NOW - timedelta(hours=1), simulated=True)
    week = week_summary(world.people[Role.PT], world.clinic, NOW)
    assert (week.simulated, week.total.sessions) == (True, 1)


def test_a_week_without_a_session_has_no_rate(world):
    week = week_summary(world.people[Role.PT], world.clinic, NOW)
    assert (week.total.sessions, week.total.hit_rate, week.types) == (0, None, [])


# --- today --------------------------------------------------------------------------------------


def test_today_lists_open_sessions_first_and_yesterdays_not_at_all(world, rosa):
    done = ago(rosa, "positive", strides(3, 1), NOW - timedelta(hours=1))
    runs = ago(rosa, "binary", strides(3, 1), NOW - timedelta(hours=2), end=None)
    left = ago(rosa, "negative", strides(3, 1), NOW - timedelta(days=2), end=None)
    TrainingSession.everywhere.filter(pk=left.pk).update(state=State.PAUSED.value)
    ago(rosa, "explicit", strides(3, 1), NOW - timedelta(days=1))
    ago(rosa, "positive", strides(1, 1), NOW - timedelta(hours=3), end=ChangeKind.ABORT)
    lines = sessions_today(world.people[Role.PT], world.clinic, NOW)
    told = [(line.session.pk, line.state, line.hit_rate) for line in lines]
    assert [state for _, state, _ in told] == ["Running", "Paused", "Finished", "Ended early"]
    assert [key for key, _, _ in told[:3]] == [runs.pk, left.pk, done.pk]
    assert told[2][2] == "75\N{NO-BREAK SPACE}%"
    assert [line.time for line in lines][:3] == ["08:00", "14 Sep, 10:00", "09:00"]


def test_what_was_left_open_is_told_however_many_walked_since(world, rosa, monkeypatch):
    monkeypatch.setattr(dashboard, "MAX_ENDED", 3)
    pt = world.people[Role.PT]
    left = ago(rosa, "positive", strides(3, 1), NOW - timedelta(days=1), end=None)
    for hours in range(5):
        ago(rosa, "binary", strides(1, 1), NOW - timedelta(hours=hours))
    told = dashboard_context(pt, NOW)
    assert [line.state for line in told["today"]] == ["Running", *["Finished"] * 3]
    assert told["today"][0].session == left
    assert told["walking"] == 1
    assert "The session of Rosa has been open since 15 Sep" in told["alerts"][0].message


def test_the_hit_rate_of_who_walks_is_told_as_it_stands(world, rosa, monkeypatch):
    session = ago(rosa, "positive", strides(3, 1), NOW, end=None)
    pt = world.people[Role.PT]
    elsewhere = sessions_today(pt, world.clinic, NOW)[0]  # another process runs it
    assert (elsewhere.state, elsewhere.is_open, elsewhere.hit_rate) == ("Running", True, "")
    told = dashboard_context(pt, NOW)
    assert told["walking"] == 1
    assert [status.connected for status in told["stations"]] == [{}] * len(told["stations"])
    page = front(pt)
    assert "running open" in page
    assert "missing" not in page  # nobody here knows who is connected there
    fold = SimpleNamespace(feedback=Tally(judged=4, hits=3), active_s=125.0)
    running = SimpleNamespace(
        aggregate=SimpleNamespace(fold=fold),
        presence=lambda _now: {"source": True, "tablets": 0, "robot": False},
    )
    live = SimpleNamespace(sessions={session.pk: running})
    monkeypatch.setattr(runtime, "peek", lambda: live)
    here = sessions_today(pt, world.clinic, NOW)[0]
    assert (here.duration, here.hit_rate) == (format_duration(125), "75\N{NO-BREAK SPACE}%")
    page = front(pt)
    assert (
        "75\N{NO-BREAK SPACE}%"
        in re.search(r'<li class="running open">.*?</li>', page, re.DOTALL)[0]
    )


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"token_expires_at": NOW}, "has expired"),
        ({"copy_seen_at": NOW - timedelta(days=3)}, "An old token of"),
    ],
)
def test_a_device_whose_token_is_over_or_was_copied_wants_attention(world, rosa, fields, words):
    Device.everywhere.filter(pk=world.device.pk).update(last_seen_at=NOW, **fields)
    alerts = dashboard_context(world.people[Role.PT], NOW)["alerts"]
    assert [words in alert.message for alert in alerts if alert.key == world.device.pk] == [True]


def test_a_session_left_open_and_a_device_never_seen_want_attention(world, rosa):
    pt = world.people[Role.PT]
    ago(rosa, "positive", strides(3, 1), NOW - timedelta(hours=4), end=None)
    station = world.rows[Station]
    names = {"new": {}, "never": {}, "revoked": {"revoked_at": NOW}}
    for name, fields in names.items():
        device = Device(
            clinic=world.clinic, station=station, kind="robot", name=name, token_hash=name, **fields
        )
        device.save()
        made = NOW if name == "new" else NOW - timedelta(days=1)
        Device.everywhere.filter(pk=device.pk).update(created_at=made)
    Device.everywhere.filter(pk=world.device.pk).update(last_seen_at=NOW)
    told = dashboard_context(pt, NOW)
    words = [alert.message for alert in find_alerts(pt, told["today"], told["stations"], NOW)]
    assert len(words) == 2
    assert words[0] == "The session of Rosa has been open since 06:00. End it."
    assert words[1].startswith("never at ")
    assert "has never connected" in words[1]


@pytest.mark.parametrize(
    ("ago", "words"),
    [
        (None, "never seen"),
        (timedelta(seconds=90), "seen just now"),
        (timedelta(minutes=12), "seen 12 minutes ago"),
        (timedelta(hours=5), "seen 5 hours ago"),
        (timedelta(days=3), "seen on 13 Sep 2026"),
    ],
)
def test_it_is_said_when_a_device_was_there(ago, words):
    assert format_last_seen(ago and NOW - ago, NOW) == words


# --- the page, for each role --------------------------------------------------------------------


def front(user: User) -> str:
    answer = signed_in(user).get("/admin/")
    assert answer.status_code == 200
    return answer.content.decode()


def test_a_therapist_is_led_to_the_monitor_of_who_walks(world, rosa):
    session = ago(rosa, "positive", strides(3, 1), timezone.now(), end=None)
    page = front(world.people[Role.PT])
    assert "1 person is walking now" in page
    assert f'href="{reverse("monitor", args=[session.pk])}"' in page
    chart = json.loads(re.search(r'<script id="week"[^>]*>(.*?)</script>', page, re.DOTALL)[1])
    assert len(chart["days"]) == len(chart["minutes"]) == 7


def test_a_researcher_sees_pseudonyms_and_no_station(world, rosa):
    record_consent(rosa, Purpose.RESEARCH, None, timezone.now())
    session = ago(rosa, "positive", strides(3, 1), timezone.now(), end=None)
    page = front(world.people[Role.RESEARCHER])
    assert rosa.pseudonym in page
    assert "Rosa" not in page
    assert mark("amber", Device) not in page
    assert reverse("monitor", args=[session.pk]) not in page


def test_a_host_sees_clinics_and_the_server_and_no_patient(world, rosa, monkeypatch):
    ago(rosa, "positive", strides(3, 1), timezone.now(), end=None)
    build_world("birch")
    host = User.everywhere.create_user("host", role=Role.HOST)
    Clinic.everywhere.create(name="Without a lead")
    page = front(host)
    assert "This server" in page
    assert mark("amber", Clinic) in page
    assert mark("birch", Clinic) in page
    assert "Without a lead has no lead." in page
    assert "SQLite" in page or "PostgreSQL" in page
    assert "up to date" in page
    monkeypatch.setattr(server_status, "count_pending_migrations", lambda: 3)
    page = front(host)
    assert "changes due: 3" in page
    assert "The database lacks changes of this version: 3. Run" in page
    for word in ("Rosa", rosa.pseudonym, mark("amber", Patient), "walking now"):
        assert word not in page


def test_models_stand_under_headings_with_a_line_each(world):
    page = front(world.people[Role.LEAD])
    headings = re.findall(r'<section class="module\b[^>]*>\s*<h2>(.*?)</h2>', page)
    assert headings[:5] == [
        "Patients &amp; sessions",
        "Feedback &amp; protocols",
        "Leaderboards",
        "Places &amp; devices",
        "People",
    ]
    assert "Who walks: code, nickname, leg" in page
    assert "More" not in headings, "rehab/admin_site.py says no heading for a model"


def test_the_front_page_costs_the_same_however_much_was_walked(
    world, rosa, django_assert_num_queries, django_assert_max_num_queries
):
    pt = client_of(world)
    now = timezone.now()
    ago(rosa, "positive", strides(2, 1), now)
    world.add_tablet()
    pt.get("/admin/")
    with django_assert_max_num_queries(15) as first:
        pt.get("/admin/")
    for number in range(8):
        patient = make_patient(world.clinic, "M", code=f"M-{number}")
        ago(patient, "positive", strides(2, 1), now, end=None if number % 2 else ChangeKind.FINISH)
        station = Station.everywhere.create(clinic=world.clinic, name=f"S-{number}")
        Device(
            clinic=world.clinic, station=station, kind="tablet", name="t", token_hash=f"{number}"
        ).save()
    with django_assert_num_queries(len(first.captured_queries)):
        pt.get("/admin/")
