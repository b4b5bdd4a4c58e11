"""Adverse events: proposed from the logs, judged, due, and seen by arm by a monitor alone."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.urls import reverse

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.sessions.log import SessionEvent
from rehab.studies.blinding import Task, give_mark
from rehab.studies.record.adverse_events import AdverseEvent, listing_rows, propose, record
from rehab.studies.visits import Place, start_session
from rehab.training.measures import InvalidSetting
from tests.support.studies import enrolled, new_patient, running_study
from tests.support.world import NOW, client_of, signed_in

pytestmark = pytest.mark.django_db


def fallen(world, *kinds: str):
    """Return a running study, and a participant in whose session this was noted."""
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    session = start_session(enrollment, Place(), None, NOW)
    for kind in kinds:
        SessionEvent.everywhere.create(session=session, kind=kind, after_number=0, at=NOW)
    return study, enrollment


def test_falls_and_stops_of_the_robot_are_proposed_until_they_are_judged(world):
    study, enrollment = fallen(world, "fall", "fall", "fall_withdrawn", "robot_stop", "rest")
    found = propose(study)
    assert [(whose.code, event.kind) for whose, event in found] == [
        (enrollment.code, "fall"),
        (enrollment.code, "robot_stop"),
    ]
    event = AdverseEvent(enrollment=enrollment, entry=found[0][1], grade=2, relation="possible")
    record(event, NOW)
    assert [one.kind for _whose, one in propose(study)] == ["robot_stop"]
    with pytest.raises(InvalidSetting, match="judged already"):
        record(AdverseEvent(enrollment=enrollment, entry=found[0][1], grade=1), NOW)
    with pytest.raises(InvalidSetting, match="Say what happened"):
        record(AdverseEvent(enrollment=enrollment, what=" ", grade=1), NOW)
    [row] = listing_rows(study, by_arm=True)
    assert (row["arm"], row["what"], row["due_on_day"]) == (
        enrollment.allocation.group,
        "fall",
        None,
    )


@pytest.mark.parametrize(
    ("grade", "serious", "relation", "expected", "days"),
    [
        (3, False, "certain", False, (None, None)),
        (2, True, "possible", False, (1, 15)),  # the sponsor hears of each within a day
        (4, False, "probable", False, (1, 7)),
        (5, True, "certain", True, (1, None)),
        (3, True, "none", False, (1, None)),
    ],
)
def test_deadlines_follow_from_how_an_event_is_judged(grade, serious, relation, expected, days):
    event = AdverseEvent(grade=grade, serious=serious, relation=relation, expected=expected, at=NOW)
    ends = tuple(day and NOW + timedelta(days=day) for day in days)
    assert (event.due_at, event.authority_due_at) == ends


def test_a_judged_fall_that_was_none_hides_no_other_one(world):
    study, enrollment = fallen(world, "fall", "fall")
    [first, second] = [event for _whose, event in propose(study)]
    record(AdverseEvent(enrollment=enrollment, entry=second, grade=0, relation="none"), NOW)
    log = {"session": first.session, "after_number": 0, "at": NOW}
    SessionEvent.everywhere.create(kind="fall_withdrawn", **log)
    SessionEvent.everywhere.create(kind="pain", value=0.0, **log)  # none was felt
    assert [event for _whose, event in propose(study)] == [first]


def test_who_treats_judges_and_reports_and_only_a_monitor_sees_arms(world):
    study, enrollment = fallen(world, "fall")
    url = reverse("study-harms", args=[study.pk])
    pt = client_of(world, Role.PT)
    [(_whose, entry)] = propose(study)
    judged = {"entry": entry.pk, "grade": 4, "relation": "possible", "what": ""}
    assert pt.post(url, judged).status_code == 302
    again = pt.post(url, judged, follow=True).content.decode()
    assert "judged already" in again
    event = AdverseEvent.everywhere.get(enrollment=enrollment)
    assert (event.grade, event.entry_id, event.by.role) == (4, entry.pk, Role.PT)
    assert "Has been reported" in again
    arm_column = "<th>Arm</th>"
    assert arm_column not in again
    pt.post(url, {"report": event.pk})
    event.refresh_from_db()
    assert event.reported_at is not None
    monitor = User.everywhere.create_user("mo", role=Role.RESEARCHER, clinic=world.clinic)
    assert signed_in(monitor).get(url).status_code == 403
    give_mark(study, monitor, Task.MONITOR, None, NOW)
    with pytest.raises(InvalidSetting, match="Let one person"):
        give_mark(study, monitor, Task.INTERIM, None, NOW)
    seen = signed_in(monitor).get(url).content.decode()
    assert arm_column in seen
    assert f"<td>{enrollment.allocation.group}</td>" in seen
    assert enrollment.patient.nickname not in seen
    assessor = User.everywhere.create_user("as", role=Role.PT, clinic=world.clinic)
    study.marks.create(study=study, user=assessor, task="assessor")
    assert signed_in(assessor).get(url).status_code == 403
    assert signed_in(assessor).get(reverse("study-checklists", args=[study.pk])).status_code == 403


def test_an_adverse_event_names_nobody_whom_a_monitor_must_not_know(world):
    study, enrollment = fallen(world)
    sent = {"enrollment": enrollment.pk, "grade": 2, "relation": "none"}
    url = reverse("study-harms", args=[study.pk])
    named = sent | {"what": f"{enrollment.patient.nickname} fell on the ward"}
    refused = client_of(world, Role.PT).post(url, named).content.decode()
    assert "researchers read this too" in refused
    assert not AdverseEvent.everywhere.filter(enrollment=enrollment).exists()
