"""Points at stake: boards show what was kept of them, and the log says how many that were."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from rehab.boards.ranking.counted_sessions import CountedSession
from rehab.training.summary.metrics import compute_metrics
from rehab.training.valences import NEGATIVE
from tests.support.clock import HERE
from tests.training.sessions import make_plan, start, walk

HIT, MISS = 5.0, 3.0


@given(st.lists(st.sampled_from([HIT, MISS, MISS, MISS]), min_size=20, max_size=60))
def test_the_points_that_are_kept_are_those_of_the_hits(values: list[float]) -> None:
    fold = start(make_plan(valence=NEGATIVE.slug))
    walk(fold, values)
    cost = -(NEGATIVE.miss_points or 0)
    session = CountedSession(
        session_id=0,
        patient_id=0,
        valence=NEGATIVE.slug,
        is_mixed=False,
        at=HERE,
        day=HERE.date(),
        values=compute_metrics(fold),
        miss_cost=cost,
    )
    assert session.points_at_stake("score") == cost * len(values)
    assert session.figure("score") == cost * values.count(HIT)
