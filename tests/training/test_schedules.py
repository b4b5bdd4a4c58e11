"""After which steps the patient is told, and that scoring does not depend on it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rehab.training.measures import InvalidSetting
from rehab.training.phases import make_phase
from rehab.training.schedules import Schedule, ScheduleKind, check_schedule_kind
from tests.training.sessions import make_plan, start, walk

SCHEDULES = st.builds(
    Schedule,
    kind=st.sampled_from(ScheduleKind),
    interval=st.integers(2, 9),
    band=st.floats(0.01, 0.4),
    stage=st.integers(1, 20),
)


def told_of(schedule, performances):
    return [n for n, one in enumerate(performances, 1) if schedule.answers(n, one)]


def test_each_schedule_tells_what_its_name_says():
    assert told_of(Schedule(), [1.0] * 4) == [1, 2, 3, 4]
    assert told_of(Schedule(interval=3), [1.0] * 7) == [3, 6]
    assert told_of(Schedule(ScheduleKind.SUMMARY, 4), [1.0] * 9) == [4, 8]
    assert told_of(Schedule(ScheduleKind.BANDWIDTH, band=0.1), [1.0, 1.09, 1.2, 0.95, 0.8]) == [
        3,
        5,
    ]
    faded = Schedule(ScheduleKind.FADED, interval=3, stage=6)
    # Each of the first six, then every second one, then every third one for good.
    assert told_of(faded, [1.0] * 24) == [1, 2, 3, 4, 5, 6, 7, 9, 11, 13, 16, 19, 22]


@given(schedule=SCHEDULES, values=st.lists(st.one_of(st.none(), st.floats(0.1, 15)), max_size=60))
def test_scores_do_not_depend_on_what_is_told(schedule, values):
    phases = (
        make_phase("training", strides=20),
        make_phase("catch", strides=5),
        make_phase("training"),
    )
    told, all_told = start(make_plan(*phases, schedule=schedule)), start(make_plan(*phases))
    assert walk(told, values) == walk(all_told, values)
    assert told.score == all_told.score
    assert told.feedback == all_told.feedback


@given(schedule=SCHEDULES, values=st.lists(st.floats(0.1, 15), max_size=80))
def test_every_step_is_told_once_or_waits(schedule, values):
    fold, steps, hits = start(make_plan(schedule=schedule)), 0, 0
    for value in values:
        walk(fold, [value])
        if fold.delivery.answer is not None:
            assert fold.delivery.reported[-1] == fold.last_number
            steps += fold.delivery.answer.steps
            hits += fold.delivery.answer.hits
    assert steps + fold.delivery.pending.steps == len(values)
    assert hits + fold.delivery.pending.hits == fold.feedback.hits


def test_an_unknown_schedule_is_refused_with_the_known_ones():
    with pytest.raises(InvalidSetting, match="every, bandwidth, faded, summary"):
        check_schedule_kind("sometimes")
