"""Steps and events are evidence: only added, and sealed so that one changed row is found."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest
from django.db import IntegrityError, connection, transaction

from rehab.patients.erasure import erase
from rehab.people.audit import append_only_triggers
from rehab.people.models import ErasureReason, Patient
from rehab.people.roles import Role
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import Remark, SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.seals import BATCH_ROWS, SessionSeal, find_broken, seal_sessions
from rehab.training.changes import Change, ChangeKind
from rehab.training.steps import Measurement, Side
from tests.support.walks import HIT, walk
from tests.support.world import NOW, World, store

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]

WORDS = {"value": {"valence": "positive", "bands": [{"from_percent": 0, "words": "Go, Rosa"}]}}


@pytest.fixture
def walked(world: World) -> TrainingSession:
    """A session longer than a batch, whose words name the patient."""
    session = walk(world.patient, "positive", [HIT] * (BATCH_ROWS + 20))
    SessionEvent.everywhere.create(
        session=session, after_number=1, kind=ChangeKind.FEEDBACK_TEXT, at=NOW, data=WORDS
    )
    seal_sessions(NOW)
    assert list(find_broken()) == []
    return session


def change(sql: str, *values: Any) -> None:
    """Change rows as somebody does who gets around the triggers."""
    with append_only_triggers.lifted("default"), connection.cursor() as cursor:
        cursor.execute(sql, values)
        assert cursor.rowcount == 1


@pytest.mark.parametrize(
    "sql",
    [
        "UPDATE rehab_step SET value = 9",
        "UPDATE rehab_step SET extra = '{}'",
        "DELETE FROM rehab_step",
        "UPDATE rehab_sessionevent SET value = 9",
        "UPDATE rehab_sessionevent SET data = '{}'",
        "DELETE FROM rehab_sessionevent",
        "DELETE FROM rehab_sessionseal",
        "UPDATE rehab_sessionseal SET replaced_at = sealed_at",
    ],
)
def test_the_database_itself_refuses(walked, sql):
    with pytest.raises(IntegrityError, match="append-only"), transaction.atomic():
        connection.cursor().execute(sql)


@pytest.mark.parametrize(
    ("sql", "found"),
    [
        ("UPDATE rehab_step SET value = value + 1e-9", "steps {a} to {b} were changed"),
        ("UPDATE rehab_step SET reasons = '[\"late\"]'", "steps {a} to {b} were changed"),
        ("DELETE FROM rehab_step", "steps {a} to {b} were changed"),
    ],
)
@pytest.mark.parametrize("number", [1, BATCH_ROWS + 7])
def test_one_changed_step_is_found(walked, sql, found, number):
    change(f"{sql} WHERE session_id = %s AND number = %s", walked.pk, number)
    first, last = (1, BATCH_ROWS) if number == 1 else (BATCH_ROWS + 1, BATCH_ROWS + 20)
    told = list(find_broken())
    assert any(found.format(a=first, b=last) in line for line in told), told
    assert all(f"session {walked.pk}" in line for line in told)


@pytest.mark.parametrize("column", ["after_number = 3", "by_id = NULL", "data = '{\"value\": 1}'"])
def test_one_changed_event_is_found(walked, world, column):
    event = SessionEvent.everywhere.filter(session=world.session, by__isnull=False).first()
    change(f"UPDATE rehab_sessionevent SET {column} WHERE id = %s", event.pk)  # noqa: S608
    assert any("events 1 to 2 were changed" in line for line in find_broken())


def test_added_and_removed_rows_and_seals_are_found(walked):
    last = Step.everywhere.filter(session=walked).last()
    last.pk, last.number = None, last.number + 1
    last.save()
    assert any("added or removed after its last seal" in line for line in find_broken())
    change("DELETE FROM rehab_step WHERE session_id = %s AND number = %s", walked.pk, last.number)
    assert list(find_broken()) == []
    change("DELETE FROM rehab_sessionseal WHERE session_id = %s AND first_step = 1", walked.pk)
    assert any("the seal before" in line for line in find_broken())


def test_a_plan_is_sealed_with_its_steps(walked):
    plan = walked.plan | {"simulated": True}
    TrainingSession.everywhere.filter(pk=walked.pk).update(plan=plan)
    assert any("were changed" in line for line in find_broken())


def test_what_comes_after_the_end_is_sealed_too(walked):
    aggregate = SessionAggregate.load(TrainingSession.everywhere.get(pk=walked.pk))
    assert not TrainingSession.everywhere.get(pk=walked.pk).unsealed
    store(aggregate, [aggregate.log_event(Remark.FALL_ACKNOWLEDGED, None, NOW, {})])
    assert TrainingSession.everywhere.get(pk=walked.pk).unsealed
    assert seal_sessions(NOW) == 1
    assert seal_sessions(NOW) == 0
    assert list(find_broken()) == []


def test_a_running_session_is_sealed_as_it_grows(world):
    session = world.begin_session()
    aggregate = SessionAggregate(session)
    store(aggregate, aggregate.change(Change(ChangeKind.START), None, NOW))
    for number in range(1, 6):
        stride = Measurement(number, float(number), Side.LEFT, 1.0)
        store(aggregate, [aggregate.record_step(stride, NOW)])
        assert seal_sessions(NOW) == (2 if number == 1 else 1)
    assert TrainingSession.everywhere.get(pk=session.pk).unsealed
    assert list(find_broken()) == []


def test_an_erasure_wins_and_leaves_the_digest(walked, world):
    before = list(SessionSeal.everywhere.values_list("digest", flat=True))
    erase(Patient.everywhere.get(pk=world.patient.pk), ErasureReason.ASKED, None, NOW)
    assert "Rosa" not in str(list(SessionEvent.everywhere.values_list("data", flat=True)))
    assert list(SessionSeal.everywhere.values_list("digest", flat=True))[: len(before)] == before
    assert SessionSeal.everywhere.filter(replaced_at=NOW).exists()
    assert list(find_broken()) == []
    # What is left is still proven: steps by their first seals, events by new ones.
    change("UPDATE rehab_step SET value = 1 WHERE session_id = %s AND number = 2", walked.pk)
    assert any("steps 1 to" in line for line in find_broken())
    event = SessionEvent.everywhere.filter(session=walked).first()
    change("UPDATE rehab_sessionevent SET after_number = 9 WHERE id = %s", event.pk)
    assert any("events 1 to" in line for line in find_broken())


def test_only_an_erasure_excuses_a_replaced_seal(walked):
    change(
        "UPDATE rehab_sessionseal SET replaced_at = sealed_at WHERE session_id = %s"
        " AND first_step = 1",
        walked.pk,
    )
    assert any("was not erased" in line for line in find_broken())


def test_rows_are_read_again_only_as_far_back_as_is_asked(walked):
    change("UPDATE rehab_step SET value = 9 WHERE session_id = %s AND number = 1", walked.pk)
    assert list(find_broken(since=NOW + timedelta(days=1))) == []
    assert list(find_broken(since=NOW - timedelta(days=1)))


def test_a_correction_changes_no_seal(walked, world):
    from rehab.sessions.corrections import CorrectedField, correct_session

    changes = {CorrectedField.COUNTS: "no"}
    correct_session(walked, changes, "tried out", world.people[Role.LEAD], NOW)
    assert list(find_broken()) == []
