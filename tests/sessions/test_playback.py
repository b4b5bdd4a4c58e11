"""A session played back shows what its pages showed."""

from __future__ import annotations

import pytest

from rehab.people.audit import append_only_triggers
from rehab.people.roles import Role
from rehab.sessions.log import Step
from rehab.sessions.reports.replay import play_back

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]


def test_steps_that_came_too_late_are_as_quiet_as_they_were(world):
    with append_only_triggers.lifted("default"):
        Step.everywhere.filter(session=world.session, number__in=(2, 4)).update(late=True)
    played = play_back(world.people[Role.PT], world.session)
    told = [patient for *_, patient, _ in played["moments"] if patient]
    steps = {one["number"]: one for one in told if one["kind"] == "step"}
    assert {2, 4} <= set(steps)
    assert {number for number, step in steps.items() if not step["live"]} == {2, 4}
    assert all(steps[number]["confetti"] == "none" for number in (2, 4))
