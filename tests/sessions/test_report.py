"""A session on paper: the figures of its log, and all that was noted, however much that is."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta

import pytest
import time_machine

from rehab.people.audit import append_only_triggers
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.people.roles import Role
from rehab.sessions.log import SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.report import report_context
from rehab.sessions.reports.report_chart import PAPER, PHONE, draw_chart
from rehab.training.changes import Change, ChangeKind
from rehab.training.phases import make_phase
from tests.support.clock import HERE
from tests.support.page_text import article_words
from tests.support.walks import HIT, MISS, RIGHT, Walked, walk
from tests.support.world import NOW, World, client_of

pytestmark = pytest.mark.django_db


def read(world: World, session: TrainingSession, role: Role = Role.PT) -> str:
    """Return the page's words."""
    page = client_of(world, role).get(f"/sessions/{session.pk}/report/").content.decode()
    return article_words(page)


def note(session: TrainingSession, kind: str, value: float | None = None, **data) -> None:
    SessionEvent.everywhere.create(
        session=session, kind=kind, value=value, after_number=3, at=NOW, data=data
    )


def test_it_says_who_walked_what_and_how_well(world, patient):
    phases = (make_phase("baseline", strides=4), make_phase("training"))
    walked: list[Walked] = [1.0, 3.0, 2.0, 2.0, HIT, MISS, HIT, Change(ChangeKind.GOAL, 2.4), HIT]
    session = walk(patient, "positive", [*walked, None, (RIGHT, HIT)], phases=phases, wanted=0.6)
    words = read(world, session)
    assert "Rosa code B-1" in words
    assert f"{HERE:%A} {HERE.day} {HERE:%B %Y, %H:%M}" in words
    assert "Positive · left leg" in words
    assert (
        "75 % of the steps reached the goal; the target was 60 %. Ankle push-off power A2 was 12 %"
        " above the baseline. The goal went from 2.00 to 2.40 W/kg."
    ) in words
    assert "Hit rate 75 % wanted 60 %" in words
    assert "Mean with feedback 2.25 W/kg, +12 % from baseline 2.00" in words
    assert "Strides, trained leg 9 1 does not count" in words
    changed = (NOW + timedelta(seconds=7)).astimezone(HERE.tzinfo)
    assert f"Goal 2.00 W/kg → 2.40 W/kg ({changed:%H:%M})" in words
    assert re.search(r"Training yes 1\.00 5 4 3 75 % 2\.25", words)
    assert "Nothing was noted. Robot No robot." in words


def test_it_tells_how_the_session_before_went(world, patient):
    walk(patient, "binary", [HIT, MISS], days_ago=3)
    walk(patient, "negative", [HIT], days_ago=2, simulated=True)  # nobody walked it
    today = walk(patient, "positive", [HIT])
    told = "Last time 18 Nov 2026 · Binary · Hit rate 50 % · Mean 2.00 W/kg · Goal 2.00 W/kg"
    assert told in read(world, today)
    earlier = patient.sessions.exclude(pk=today.pk).order_by("created_at").first()
    assert "Last time" not in read(world, earlier)


def test_strides_that_the_lab_sent_late_are_told_apart(world, patient):
    session = walk(patient, "positive", [HIT, None, "late", "late", "force_lost"])
    told = "Strides, trained leg 5 2 do not count: not clearly measured, of 2 the samples came late"
    assert told in read(world, session)


def test_paper_and_pages_show_the_clinics_clock(world, patient):
    """Late on Saturday in UTC it is Sunday morning in Auckland."""
    world.clinic.time_zone = "Pacific/Auckland"
    world.clinic.save()
    late = datetime(2026, 11, 21, 23, 30, tzinfo=UTC)
    session = walk(patient, "positive", [HIT], now=late)
    assert "Sunday 22 November 2026, 12:30" in read(world, session)
    with time_machine.travel(late):
        page = client_of(world).get("/start/").content.decode()
        assert "printed 22 November 2026" in read(world, session)
    assert "Sunday 22 November" in page


def test_what_went_wrong_stands_near_the_top_what_else_was_noted_below(world, patient):
    session = walk(patient, "binary", [HIT, MISS])
    for kind, value in [
        ("rest", None),
        ("borg", 4),
        ("fall", None),
        ("pain", 3),
        ("borg", 7),
        ("fall", None),
    ]:
        note(session, kind, value)
    for above in (True, True, False):
        note(session, "robot_decision", above=above)
    note(session, "robot_gesture", phase="started")
    note(session, "robot_gesture", phase="ended")
    note(session, "robot_stop")
    words, at = read(world, session), f"{HERE:%H:%M}"
    assert f"Falls: 2 ({at}, not seen yet; {at}, not seen yet) Pain: 3 of 10 ({at}) Goal" in words
    assert f"Noted Rest 1 ×: {at} Exertion: 4 of 10 ({at}), 7 of 10 ({at}) Robot" in words
    assert "1 gesture, 2 of 3 decisions at or above its threshold, stopped once." in words


def test_a_fall_stands_with_how_badly_it_hurt_and_a_withdrawn_one_not_at_all(world, patient):
    session = walk(patient, "binary", [HIT, MISS])
    for kind, value in [("fall", None), ("fall_severity", 2), ("fall", None)]:
        note(session, kind, value)
    note(session, "fall_withdrawn")
    words = read(world, session)
    assert f"Falls: 1 ({HERE:%H:%M}, moderately hurt, not seen yet)" in words
    assert "Nothing else was noted." in words
    other = walk(patient, "binary", [HIT, MISS])
    note(other, "fall")
    note(other, "fall_withdrawn")
    assert "Fall" not in read(world, other)


def test_of_many_events_the_count_is_right_and_the_list_short(world, patient):
    changes = [Change(ChangeKind.GOAL, 2 + n / 100) for n in range(1, 31)]
    session = walk(patient, "positive", [HIT, *changes, HIT])
    for _ in range(400):
        note(session, "pain")
    words, at = read(world, session), f"{HERE:%H:%M}"
    assert f"Pain 400 ×: {at}, {at}, {at}, {at}, … 395 more …, {at}" in words
    assert "… 24 changes more … → 2.30 W/kg" in words
    assert len(words) < 2_500


def test_what_else_was_measured_stands_as_its_mean(world, patient):
    session = walk(patient, "positive", [HIT, MISS, HIT, None, (RIGHT, HIT)])
    extras = [{"heart_rate": 100, "flag_late": 1, "sent_value": 4}, {"heart_rate": 103}]
    # The last two are of an invalid stride, and of the other leg.
    extras += [{"power": 2}, {"heart_rate": 1}, {"heart_rate": 1}]
    for number, extra in enumerate(extras, 1):
        with append_only_triggers.lifted("default"):
            Step.everywhere.filter(session=session, number=number).update(extra=extra)
    assert "Also measured, mean heart_rate 102 · power 2.00 Notes" in read(world, session)


def test_a_researcher_reads_a_pseudonym(world, patient):
    record_consent(patient, Purpose.RESEARCH, None, NOW)
    words = read(world, walk(patient, "explicit", [HIT]), Role.RESEARCHER)
    assert patient.pseudonym in words
    assert "Rosa" not in words
    assert "B-1" not in words


@pytest.mark.parametrize("walked", [[], [None, None]])
def test_a_session_without_a_stride_has_a_page(world, patient, walked):
    session = walk(patient, "explicit", walked, end=ChangeKind.ABORT)
    words = read(world, session)
    assert ("No strides recorded." in words) == (not walked)
    assert "Ended early" in words


def test_the_chart_shows_every_stride_once(world, patient):
    phases = (make_phase("baseline", strides=2), make_phase("training"))
    strides: list[Walked] = [1.0, 1.5, HIT, MISS, None, HIT]
    strides += [Change(ChangeKind.GOAL, 3.0), HIT, MISS, 0.0]
    session = walk(patient, "positive", strides, phases=phases)
    chart = report_context(world.people[Role.PT], session)["charts"][0]
    assert chart["hit"].count("M") == 2
    assert chart["miss"].count("M") == 6
    assert chart["lost"].count("M") == 1
    assert [phase["quiet"] for phase in chart["phases"]] == [True, False]
    heights = re.findall(r"[MV](?:[\d.]+ )?([\d.]+)", chart["goal"])
    assert len(set(heights)) == 2  # both goals, the higher one above
    assert float(heights[0]) > float(heights[-1])


def test_a_chart_of_the_smallest_and_largest_values():
    for values in ([0.0], [1e-6, 2e-6], [15.0] * 3, [None]):
        count = len(values)
        columns = {"number": list(range(1, count + 1)), "value": values, "goal": [None] * count}
        verdicts = {"hit": [None] * count, "close": [False] * count}
        chart = {"strides": columns | verdicts, "phases": []}
        drawn = draw_chart(chart)
        assert drawn["strides"] == count
        assert len(drawn["levels"]) <= 8
        for number in re.findall(r"-?[\d.]+", drawn.get("free", "")):
            assert -10 < float(number) < 1010


def test_every_phase_has_its_name_in_the_chart_however_narrow():
    """Names that would run into each other stand in rows, on a phone as on paper."""
    names = {"Baseline": (1, 54), "Training": (55, 251), "Catch": (252, 263), "Washout": (264, 300)}
    phases = [
        {"name": name, "feedback": name == "Training", "from": first, "to": last}
        for name, (first, last) in names.items()
    ]
    columns = {name: [2.0] * 300 for name in ("value", "goal", "hit")}
    columns |= {"number": list(range(1, 301)), "close": [False] * 300}
    for size in (PAPER, PHONE):
        drawn = draw_chart({"strides": columns, "phases": phases}, size)
        ends: dict[float, float] = {}
        for phase in drawn["phases"]:
            assert ends.get(phase["up"], 0) <= phase["at"] <= phase["x"]
            ends[phase["up"]] = phase["at"] + 0.6 * size.letter * len(phase["name"])
        assert max(ends.values()) <= size.width


def test_close_strides_have_a_mark_of_their_own():
    columns = {"number": [1, 2, 3], "value": [2.0, 2.0, 1.0], "goal": [2.0] * 3}
    verdicts = {"hit": [True, True, False], "close": [False, True, True]}
    drawn = draw_chart({"strides": columns | verdicts, "phases": []})
    assert (drawn["hit"].count("M"), drawn["close"].count("M")) == (1, 2)
    assert "miss" not in drawn
