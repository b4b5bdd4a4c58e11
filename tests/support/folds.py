"""Folds of whole logs, without a database."""

from __future__ import annotations

from collections.abc import Iterable

from rehab.training.changes import Change
from rehab.training.fold import SessionFold
from rehab.training.plans import SessionPlan
from rehab.training.steps import Measurement


def fold_log(plan: SessionPlan, log: Iterable[Measurement | Change]) -> SessionFold:
    """Return the fold of a log. Raises what its steps and changes raise."""
    fold = SessionFold(plan)
    for entry in log:
        if isinstance(entry, Change):
            fold.change(entry)
        else:
            fold.step(entry)
    return fold
