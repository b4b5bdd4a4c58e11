"""Reads sessions' logs back: `python -m tests.support.live_log 1,2,3` prints what they hold."""

from __future__ import annotations

import json
import sys
from typing import Any

import django


def read(session_id: int) -> dict[str, Any]:
    """Return a session's step numbers, and whether folding its log again gives the verdicts."""
    from rehab.sessions.log import Step
    from rehab.sessions.log_fold import log_entries
    from rehab.sessions.models import TrainingSession
    from rehab.training.changes import Change
    from rehab.training.fold import SessionFold

    session = TrainingSession.everywhere.get(pk=session_id)
    steps = list(Step.everywhere.filter(session=session).order_by("number"))
    fold = SessionFold(session.to_plan())
    scored = []
    for entry in log_entries(session):
        if isinstance(entry, Change):
            fold.change(entry)
        else:
            scored.append(fold.step(entry))
    same = [(step.hit, step.points, step.valid, step.performance) for step in steps] == [
        (step.hit, step.points, step.valid, step.performance) for step in scored
    ]
    return {
        "numbers": [step.number for step in steps],
        "refolds": same and fold.score == sum(step.points or 0 for step in steps),
        "state": session.state,
        "valid": sum(step.valid for step in steps),
        "paused": session.events.filter(kind="pause").count(),
        "resumed": session.events.filter(kind="resume").count(),
    }


if __name__ == "__main__":
    django.setup()
    wanted = [int(word) for word in sys.argv[1].split(",")]
    print(json.dumps({session_id: read(session_id) for session_id in wanted}))
