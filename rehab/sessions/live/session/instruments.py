"""What is measured while steps go by, for monitoring (pages/metrics.py). Nothing of a patient."""

from __future__ import annotations

from prometheus_client import CollectorRegistry, Counter, Histogram

REGISTRY = CollectorRegistry()
MILLISECONDS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)

STEPS = Counter("garry_steps", "Steps that were stored.", registry=REGISTRY)
COMMIT_S = Histogram(
    "garry_commit_seconds", "How long a commit took.", registry=REGISTRY, buckets=MILLISECONDS
)
WRITE_FAILURES = Counter(
    "garry_write_failures", "Commits that failed; their steps are sent again.", registry=REGISTRY
)
LATE_S = Histogram(
    "garry_loop_late_seconds",
    "How late the event loop came to a periodic task: pages and robots waited as long.",
    registry=REGISTRY,
    buckets=MILLISECONDS,
)
