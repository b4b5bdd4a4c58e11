"""The lab's sessions, walked under our templates: the same phases, goal, display and verdicts."""

from __future__ import annotations

import pytest

from rehab.sessions.setup.default_protocols import FIRST_VISIT, LATER_VISIT
from rehab.sources.recording import read_recording
from rehab.training.fold import SessionFold
from rehab.training.measures import A2
from rehab.training.phases import make_phase
from rehab.training.scoring import judge
from rehab.training.steps import Measurement
from tests.support.data import recording as recorded_file
from tests.training.sessions import make_plan, start

HEBB_91_GOAL = 2.5498  # between the smallest recorded hit and the largest miss


def walk_recording(recording, fold: SessionFold):
    """Yield each recorded stride with the step that the session makes of it."""
    for stride in recording.strides:
        sent = stride.measurement
        yield (
            stride,
            fold.step(Measurement(sent.number, sent.time_s, sent.side, sent.value, sent.reasons)),
        )


@pytest.mark.parametrize(
    ("name", "template"),
    [("HEBB_03_Session_1.csv", FIRST_VISIT), ("HEBB_03_Session_2.csv", LATER_VISIT)],
)
def test_a_recorded_session_follows_its_template(name, template):
    recording = read_recording(recorded_file(name))
    fold = start(make_plan(*template, percent=100.0, goal=None))

    walked = list(walk_recording(recording, fold))

    assert [step.phase for _stride, step in walked] == [s.phase for s in recording.strides]
    assert [(p.kind, p.gain, p.feedback) for p in template] == [
        (p.kind, p.gain, p.feedback) for p in recording.phases
    ]
    assert fold.goal == pytest.approx(recording.goal, rel=1e-9)
    assert fold.completed
    judged = 0
    for stride, step in walked:
        if stride.recorded_hit is None:
            assert step.value is None
            continue
        # The lab judged its baseline and the strides that it called unusable, too, afterwards.
        verdict = judge(A2, step.value, step.gain, fold.goal)
        assert verdict.shown == pytest.approx(stride.recorded_shown, rel=1e-9), stride.row
        assert verdict.hit == stride.recorded_hit, stride.row
        if step.hit is not None:
            judged += 1
            assert (step.shown, step.performance, step.hit) == verdict, stride.row
    assert judged > 0.93 * len(walked)


def test_each_stride_of_hebb_91_succeeds_as_recorded():
    recording = read_recording(recorded_file("HEBB_91_Session_1.csv"))
    fold = start(make_plan(make_phase("training"), goal=HEBB_91_GOAL))

    walked = list(walk_recording(recording, fold))

    assert len(walked) == 1375
    for stride, step in walked:
        assert judge(A2, step.value, 1.0, HEBB_91_GOAL).hit == stride.recorded_hit, stride.row
        # Two contacts without force are no steps for us, and were misses for the lab.
        assert step.hit == (stride.recorded_hit if step.valid else None), stride.row
    assert fold.feedback.judged == 1373
