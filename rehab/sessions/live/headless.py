"""A whole session without pages: a recording or a simulated patient, through the live path."""

from __future__ import annotations

import asyncio
import time
from collections import defaultdict
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass
from typing import Any

from django.utils import timezone

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.orders import ChangeOrder
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.log import Step
from rehab.sessions.models import TrainingSession
from rehab.sources.recording import Recording
from rehab.sources.synthetic import SyntheticWalker
from rehab.training.changes import ChangeKind
from rehab.training.fold import SessionFold
from rehab.training.measures import A2
from rehab.training.scoring import judge
from rehab.training.steps import Measurement
from rehab.training.summary.summary import summarize_session

# Steps that are queued before waiting for the disk: few commits, constant memory.
BATCH = 500
# SQLite lets one write at a time, and whoever waits tries again each 100 ms at the latest
# (sqlite3.c, sqliteDefaultBusyCallback): so long a rest lets a server beside us have its turn.
GIVE_WAY_S = 0.12


@dataclass(frozen=True)
class Pace:
    """How fast strides arrive: ``speed`` times true cadence, or as fast as they are stored (None).

    ``rest_s``: how long the database is left to others after each batch, where that is a server's.
    Clock and sleep are parameters, so that tests do not have to wait.
    """

    speed: float | None = None
    clock: Callable[[], float] = time.monotonic
    sleep: Callable[[float], Awaitable[None]] = asyncio.sleep
    rest_s: float = 0.0


def simulate_strides(
    walker: SyntheticWalker, fold: SessionFold, count: int
) -> Iterator[Measurement]:
    """Yield a simulated patient's strides, each made for the session's phase and goal."""
    for _ in range(count):
        walker.goal_w_kg = fold.goal
        yield walker.next_stride(fold.phase)


async def run_session(
    session_id: int, strides: Callable[[SessionFold], Iterator[Measurement]], pace: Pace
) -> SessionFold:
    """Start a session, send it strides through the live path, finish it; return its fold.

    A failure leaves the session aborted, with the steps that were stored.
    """
    runtime = runtimes.current()
    try:
        live = await runtime.session(session_id)
        fold = live.aggregate.fold
        await runtime.order(session_id, ChangeOrder(ChangeKind.START, None, None))
        try:
            await _send_strides(live, strides(fold), pace)
        except BaseException:
            await runtime.order(session_id, ChangeOrder(ChangeKind.ABORT, None, None))
            raise
        await runtime.order(session_id, ChangeOrder(ChangeKind.FINISH, None, None))
        return fold
    finally:
        await runtime.drain()


async def _send_strides(live: LiveSession, strides: Iterator[Measurement], pace: Pace) -> None:
    began: float | None = None
    for count, stride in enumerate(strides, start=1):
        if pace.speed is not None:
            began = pace.clock() - stride.time_s / pace.speed if began is None else began
            await pace.sleep(max(0.0, began + stride.time_s / pace.speed - pace.clock()))
        live.record_step(stride, timezone.now())
        if count % BATCH == 0:
            await _rest(live, pace)
    await _rest(live, pace)


async def _rest(live: LiveSession, pace: Pace) -> None:
    """Wait until everything is stored, and then leave the database to others."""
    await live.wait_until_committed()
    if pace.rest_s:
        await pace.sleep(pace.rest_s)


def robot_steps(session: TrainingSession, fold: SessionFold) -> Iterator[tuple[float, float]]:
    """Yield the steps of a stored session that its robot scores: time [s] and performance."""
    sent = [i for i, phase in enumerate(fold.plan.phases) if phase.feedback and phase.robot]
    steps = Step.everywhere.filter(session=session, phase__in=sent).order_by("number")
    for time_s, performance in steps.values_list("time_s", "performance").iterator():
        if performance is not None:
            yield time_s, performance


def compare_with_recording(
    session: TrainingSession, recording: Recording
) -> dict[int, dict[str, int]]:
    """Compare our hits with the recording's own; return counts by phase.

    ``compared`` counts the rows with a recorded value and flag, valid or not; ``agree`` those where
    our rule (shown ≥ goal) agrees with the recorded flag; ``hits`` the hits by our rule.
    """
    counts: dict[int, dict[str, int]] = defaultdict(lambda: {"compared": 0, "agree": 0, "hits": 0})
    steps = Step.everywhere.filter(session=session).order_by("number").iterator()
    for step, stride in zip(steps, recording.strides, strict=True):
        if stride.recorded_hit is None or step.value is None or step.goal is None:
            continue
        hit = judge(A2, step.value, step.gain, step.goal).hit
        count = counts[step.phase]
        count["compared"] += 1
        count["agree"] += hit == stride.recorded_hit
        count["hits"] += hit
    return counts


def session_report(
    session: TrainingSession,
    fold: SessionFold,
    wall_s: float,
    recording: Recording | None = None,
    robot: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Return the JSON that `runsession` prints; ``robot`` is what a simulated robot did, if any."""
    figures = summarize_session(fold)
    if recording is not None:
        counts = compare_with_recording(session, recording)
        figures["recorded_success"] = _sum_counts(list(counts.values()))
        for phase in figures["phases"]:
            phase["recorded_success"] = _sum_counts(
                [counts[block["phase"]] for block in phase["blocks"] if block["phase"] in counts]
            )
    return {
        "session": session.pk,
        "valence": session.valence,
        **figures,
        "robot": {"base": "null", "windows": 0, "activated_share": None},
        "gestures": [],
        **(robot or {}),
        "wall_s": round(wall_s, 3),
        "steps_per_s": round(fold.last_number / wall_s) if wall_s > 0 else None,
    }


def _sum_counts(counts: list[dict[str, int]]) -> dict[str, Any]:
    total = {name: sum(count[name] for count in counts) for name in ("compared", "agree", "hits")}
    rate = total["hits"] / total["compared"] if total["compared"] else None
    return {**total, "hit_rate": rate}
