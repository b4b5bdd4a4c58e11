"""A session's state, computed from its log: ``SessionFold`` and what it consists of."""

from rehab.training.fold.session_fold import MAX_GAP_S, SessionFold

__all__ = ["MAX_GAP_S", "SessionFold"]
