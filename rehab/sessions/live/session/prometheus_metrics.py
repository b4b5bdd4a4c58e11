"""What is measured of steps, for monitoring (pages/server/metrics.py). Nothing of a patient."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from prometheus_client import CollectorRegistry, Counter, Histogram

try:
    from opentelemetry.trace import get_tracer
except ImportError:  # the extra `tracing` is not installed
    TRACER = None
else:
    TRACER = get_tracer("garry")  # records nothing unless traces are sent (garry_site/tracing.py)

REGISTRY = CollectorRegistry()
MILLISECONDS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)

STEPS = Counter("garry_steps", "Steps that were stored.", registry=REGISTRY)
COMMIT_S = Histogram(
    "garry_commit_seconds", "How long a commit took.", registry=REGISTRY, buckets=MILLISECONDS
)
DELIVERY_S = Histogram(
    "garry_delivery_seconds",
    "From a step's coming in until it is stored and handed to its session's viewers here.",
    registry=REGISTRY,
    buckets=MILLISECONDS,
)
WRITE_FAILURES = Counter(
    "garry_write_failures", "Commits that failed; their steps are sent again.", registry=REGISTRY
)
TASK_FAILURES = Counter(
    "garry_task_failures",
    "Periodic tasks of the server that failed; each is tried again.",
    ["task"],
    registry=REGISTRY,
)
LOOP_LATE_S = Histogram(
    "garry_loop_late_seconds",
    "How late the event loop came to a periodic task: pages and robots waited as long.",
    registry=REGISTRY,
    buckets=MILLISECONDS,
)


@contextmanager
def measure_commit(sessions: int, rows: int) -> Iterator[None]:
    """Time a commit, for Prometheus and in a trace."""
    with COMMIT_S.time():
        if TRACER is None:
            yield
        else:
            counts = {"garry.sessions": sessions, "garry.rows": rows}
            # Without the error's words: the database's may quote a row.
            with TRACER.start_as_current_span(
                "commit", attributes=counts, record_exception=False, set_status_on_exception=False
            ):
                yield
    STEPS.inc(rows)
