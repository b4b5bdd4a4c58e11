"""The log is the truth: what was committed rebuilds the session, and nothing else counts."""

from __future__ import annotations

import dataclasses
from datetime import datetime, timedelta
from typing import Any

import pytest
from django.db import connection
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rehab.people.models import Clinic, Patient
from rehab.people.scope import CrossClinicReference
from rehab.sessions.live.session.aggregate import SessionAggregate, StepRow
from rehab.sessions.live.session.commit_transaction import STORED_COLUMNS, LogDiffers
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import SessionRequest, create_session
from rehab.stations.models import Station
from rehab.training.changes import Change, ChangeKind, NotAllowed
from rehab.training.fold.checkpoints import fold_to_json
from rehab.training.goals import GoalRule
from rehab.training.measures import InvalidSetting
from rehab.training.phases import make_phase
from rehab.training.scoring import RULES_VERSION
from rehab.training.steps import Measurement, Side
from rehab.training.summary.metrics import compute_metrics
from tests.support.extent import examples
from tests.support.walks import make_patient
from tests.support.world import NOW, store

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]

TRAINING = (make_phase("training"),)


@pytest.fixture
def patient() -> Patient:
    clinic = Clinic.everywhere.create(name="Elm")
    return make_patient(clinic, code="7")


def begin(patient: Patient, valence: str = "binary", **settings: Any) -> SessionAggregate:
    defaults: dict[str, Any] = {"goal": GoalRule(value=3.0), "phases": TRAINING}
    aggregate = SessionAggregate(
        create_session(SessionRequest(patient=patient, valence=valence, **defaults | settings))
    )
    change(aggregate, ChangeKind.START)
    return aggregate


def change(
    aggregate: SessionAggregate, kind: ChangeKind, value: float | None = None, at: datetime = NOW
) -> None:
    store(aggregate, aggregate.change(Change(kind, value), None, at))


def walk(aggregate: SessionAggregate, *values: float | None, reasons: tuple[str, ...] = ()) -> None:
    first = aggregate.fold.last_number + 1
    strides = [
        Measurement(first + i, (first + i) * 1.1, Side.LEFT, value, reasons, {"step_length_m": 0.5})
        for i, value in enumerate(values)
    ]
    store(aggregate, [aggregate.record_step(stride, NOW) for stride in strides])


def reread(aggregate: SessionAggregate) -> TrainingSession:
    return TrainingSession.everywhere.get(pk=aggregate.session.pk)


def test_every_field_of_a_step_is_kept(patient):
    aggregate = begin(patient, phases=(make_phase("training", gain=0.85),))
    walk(aggregate, 4.0)
    step = Step.everywhere.get()
    kept = {field.name: getattr(step, field.name) for field in Step._meta.concrete_fields}
    del kept["id"]
    assert kept == {
        "session": aggregate.session,
        "number": 1,
        "time_s": 1.1,
        "received_at": NOW,
        "side": "left",
        "value": 4.0,
        "gain": 0.85,
        "shown": 3.4,
        "goal": 3.0,
        "performance": pytest.approx(3.4 / 3),
        "hit": True,
        "close": False,
        "late": False,
        "points": 1,
        "valid": True,
        "reasons": [],
        "phase": 0,
        "rules_version": RULES_VERSION,
        "extra": {"step_length_m": 0.5},
    }


def test_the_writer_writes_every_column_of_a_step():
    columns = {field.column for field in Step._meta.concrete_fields}
    assert set(STORED_COLUMNS) == columns - {"id"}


def test_date_start_duration_score_type_and_goal_are_there_to_read(patient):
    aggregate = begin(patient, "positive")
    walk(aggregate, 4.0, 2.0, 3.0, None)
    change(aggregate, ChangeKind.FINISH, at=NOW + timedelta(minutes=1))
    session = reread(aggregate)
    assert session.started_at == NOW
    assert session.ended_at == NOW + timedelta(minutes=1)
    assert session.active_s == pytest.approx(3.3)
    assert (session.valence, session.goal, session.state) == ("positive", 3.0, "finished")
    figures = dict(SessionMetric.everywhere.values_list("slug", "value"))
    assert figures["score"] == 2
    assert figures["hit_rate"] == pytest.approx(2 / 3)


def test_events_say_who_changed_what_after_which_step(patient):
    aggregate = begin(patient)
    walk(aggregate, 4.0, 4.0)
    change(aggregate, ChangeKind.GOAL, 3.5)
    walk(aggregate, 3.2)
    event = SessionEvent.everywhere.get(kind="goal")
    assert (event.after_number, event.old, event.value) == (2, 3.0, 3.5)
    assert list(Step.everywhere.order_by("number").values_list("goal", "hit")) == [
        (3.0, True),
        (3.0, True),
        (3.5, False),
    ]


def test_a_refused_change_leaves_no_trace(patient):
    aggregate = begin(patient)
    with pytest.raises(InvalidSetting, match="15"):
        change(aggregate, ChangeKind.GOAL, 99.0)
    with pytest.raises(NotAllowed):
        change(aggregate, ChangeKind.RESUME)
    assert list(SessionEvent.everywhere.values_list("kind", flat=True)) == ["start"]


def test_a_number_that_is_taken_writes_nothing_of_its_batch(patient):
    aggregate = begin(patient)
    walk(aggregate, 4.0)
    again = aggregate.record_step(Measurement(2, 2.2, Side.LEFT, 4.0), NOW)
    taken = again._replace(step=dataclasses.replace(again.step, number=1))
    with pytest.raises(LogDiffers):
        store(aggregate, [taken])
    with pytest.raises(LogDiffers):
        store(aggregate, [again, taken])
    assert Step.everywhere.count() == 1


def fold_state(aggregate: SessionAggregate) -> dict[str, Any]:
    state: dict[str, Any] = dict(vars(aggregate.fold))
    for name in ("trained", "feedback"):
        state[name] = dataclasses.asdict(state[name])
    state["phases"] = [dataclasses.asdict(tally) for tally in state["phases"]]
    return state


actions = st.lists(
    st.one_of(
        st.lists(
            st.sampled_from([None, -1.0, 2.0, 3.0, 4.5, 25.0, float("inf")]), min_size=1, max_size=4
        ),
        st.sampled_from(
            [
                (ChangeKind.PAUSE, None),
                (ChangeKind.RESUME, None),
                (ChangeKind.GOAL, 2.5),
                (ChangeKind.GAIN, 0.85),
                (ChangeKind.PHASE, 0),
                (ChangeKind.PHASE, 2),
                (ChangeKind.ACTIVATION_THRESHOLD, 0.8),
            ]
        ),
    ),
    max_size=12,
)


@pytest.mark.wide
@settings(
    max_examples=examples(40),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(actions=actions)
def test_folding_the_log_rebuilds_the_actor_exactly(patient, actions):
    phases = (
        make_phase("training", strides=3),
        make_phase("catch", seconds=4.0),
        make_phase("training", gain=0.9),
    )
    aggregate = begin(patient, phases=phases)
    for action in actions:
        if isinstance(action, list):
            walk(aggregate, *action, reasons=("flagged",) if len(action) == 3 else ())
        else:
            try:
                change(aggregate, *action)
            except InvalidSetting:
                continue
    rebuilt = SessionAggregate.load(reread(aggregate))
    assert fold_state(rebuilt) == fold_state(aggregate)
    assert compute_metrics(rebuilt.fold) == compute_metrics(aggregate.fold)
    session = reread(aggregate)
    assert (session.state, session.goal) == (aggregate.fold.state, aggregate.fold.goal)
    stored = Step.everywhere.filter(session=session)
    points = sum(step.points or 0 for step in stored)
    assert points == (aggregate.fold.score or 0)


def test_old_sessions_fold_by_the_rules_that_they_were_stored_with(patient):
    """Strides of two legs that overtake each other: version 1 doubted them, later ones do not."""
    aggregate = begin(patient)
    strides = [(1.0, "left", 1), (1.6, "right", 1), (1.5, "left", 1), (2.1, "right", None)]
    for number, (time_s, side, version) in enumerate([*strides, (2.05, "left", None)], 1):
        stride = Measurement(number, time_s, Side(side), 4.0, rules_version=version)
        store(aggregate, [aggregate.record_step(stride, NOW)])
    stored = Step.everywhere.order_by("number").values_list("rules_version", "valid")
    assert list(stored) == [(1, True), (1, True), (1, False), *[(RULES_VERSION, True)] * 2]
    rebuilt = SessionAggregate.load(reread(aggregate))
    assert fold_state(rebuilt) == fold_state(aggregate)


def test_a_checkpoint_that_is_ahead_of_its_log_is_not_used(patient):
    aggregate = begin(patient)
    walk(aggregate, 4.0, 4.0)
    session = reread(aggregate)
    session.checkpoint = fold_to_json(aggregate.fold) | {"last_number": 9}
    assert fold_state(SessionAggregate.load(session)) == fold_state(aggregate)


def test_steps_are_indexed_once():
    with connection.cursor() as cursor:
        found = connection.introspection.get_constraints(cursor, Step._meta.db_table)
    indexes = [tuple(one["columns"]) for one in found.values() if one["index"] or one["unique"]]
    assert indexes.count(("session_id", "number")) == 1
    assert ("session_id",) not in indexes


def test_what_could_not_have_been_is_passed_over_and_nothing_else_is_lost(patient, caplog):
    def slip_in(kind: str, value: float | None = None) -> None:
        after = aggregate.fold.last_number
        SessionEvent.everywhere.create(
            session=aggregate.session, after_number=after, kind=kind, value=value, at=NOW
        )

    aggregate = begin(patient)
    walk(aggregate, 4.0)
    change(aggregate, ChangeKind.PAUSE)
    slip_in("pause")  # by another process that believed that the session was its own
    walk(aggregate, 4.0)
    change(aggregate, ChangeKind.RESUME)
    slip_in("start")
    walk(aggregate, 4.0, 2.0)
    slip_in("goal", -1.0)
    change(aggregate, ChangeKind.GOAL, 3.5)
    rebuilt = SessionAggregate.load(reread(aggregate))
    assert fold_state(rebuilt) == fold_state(aggregate)
    (warning,) = caplog.messages
    assert "Skipped 3 impossible entries" in warning
    assert "a session that is paused" in warning.lower()
    walk(rebuilt, 4.0)
    assert SessionAggregate.load(reread(aggregate)).fold.last_number == 5


def test_strides_after_the_end_hide_no_session(patient, caplog):
    aggregate = begin(patient)
    walk(aggregate, 4.0, 4.0)
    other = SessionAggregate.load(reread(aggregate))
    change(aggregate, ChangeKind.FINISH)
    walk(other, 4.0)
    loaded = SessionAggregate.load(reread(aggregate))
    assert (loaded.fold.state, loaded.fold.score) == ("finished", 2)
    assert "Skipped 1 impossible entries" in caplog.text


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"valence": "kind"}, "Known valences: positive"),
        ({"goal": GoalRule(value=0.0)}, "above 0 and up to 15"),
        ({"goal": GoalRule(value=float("nan"))}, "above 0 and up to 15"),
        ({"phases": ()}, "at least one phase"),
        ({"goal": GoalRule(percent_of_baseline=100)}, "needs a baseline phase"),
        ({"phases": None}, "needs a protocol"),
    ],
)
def test_a_session_that_could_not_be_walked_is_not_created(patient, settings, message):
    with pytest.raises(InvalidSetting, match=message):
        begin(patient, **settings)
    assert not TrainingSession.everywhere.exists()


def test_which_leg_is_trained_must_be_known(patient):
    patient.paretic_side = ""
    with pytest.raises(InvalidSetting, match="Which leg"):
        begin(patient)


def test_a_session_stays_within_one_clinic(patient):
    elsewhere = Clinic.everywhere.create(name="Oak")
    station = Station.everywhere.create(clinic=elsewhere, name="Belt 1")
    with pytest.raises(CrossClinicReference, match="same clinic"):
        begin(patient, station=station)
    assert not TrainingSession.everywhere.exists()


def test_steps_without_values_come_back_from_the_log_as_they_were(patient):
    aggregate = begin(patient)
    walk(aggregate, float("nan"), None, 99.0)
    assert [step.reasons for step in Step.everywhere.order_by("number")] == [
        ["not_finite"],
        ["missing"],
        ["out_of_bounds"],
    ]
    assert Step.everywhere.get(number=1).value is None
    assert isinstance(aggregate.record_step(Measurement(4, 9.0, Side.RIGHT, 3.0), NOW), StepRow)
