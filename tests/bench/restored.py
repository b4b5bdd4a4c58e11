"""Sessions that a crash left running, half an hour each: how long until all are back (JSON)."""

from __future__ import annotations

import asyncio
import json
import sys
import time

STEPS = 1800


def fill(count: int) -> None:
    """Leave so many running sessions behind, with the same walk."""
    from django.db import connection
    from django.utils import timezone

    from rehab.sessions.live.session.aggregate import CHECKPOINT_STEPS, SessionAggregate
    from rehab.sessions.log import Step
    from rehab.sessions.models import TrainingSession
    from rehab.sessions.ownership import ClinicOwner
    from rehab.sources.synthetic import PROFILES, SyntheticWalker
    from rehab.training.fold.checkpoints import fold_to_json
    from rehab.training.steps import Side
    from tests.support.live_seed import seed
    from tests.support.world import store

    ids = [row["session"] for row in seed(count)]
    aggregate = SessionAggregate.load(TrainingSession.everywhere.get(pk=ids[0]))
    walker, checkpoint = SyntheticWalker(PROFILES["good"], 1, Side.LEFT), {}
    for number in range(1, STEPS + 1):
        step = walker.next_stride(aggregate.fold.phase)
        store(aggregate, [aggregate.record_step(step, timezone.now())])
        if number % CHECKPOINT_STEPS == 0 and number < STEPS:
            checkpoint = fold_to_json(aggregate.fold)
    names = [f.column for f in Step._meta.concrete_fields if f.column not in ("id", "session_id")]
    columns = ", ".join(names)
    chosen = ", ".join(f"step.{name}" for name in names)
    with connection.cursor() as cursor:
        cursor.execute(
            f"INSERT INTO rehab_step (session_id, {columns}) "  # noqa: S608
            f"SELECT session.id, {chosen} "
            "FROM rehab_trainingsession AS session, rehab_step AS step "
            "WHERE step.session_id = %s AND session.id <> %s",
            [ids[0], ids[0]],
        )
    TrainingSession.everywhere.filter(pk__in=ids).update(last_number=STEPS, checkpoint=checkpoint)
    ClinicOwner.everywhere.update(owner="gone|1|1")


async def restore() -> tuple[int, float, float]:
    """Recover all; return how many, in how many seconds, and of what processor time."""
    from rehab.sessions.live import process, runtime

    process.tune_interpreter()  # as servers begin
    began, spent_s = time.perf_counter(), time.process_time()
    count = await runtime.current().recover()
    took_s, spent_s = time.perf_counter() - began, time.process_time() - spent_s
    await runtime.current().drain()
    return count, took_s, spent_s


if __name__ == "__main__":
    import django

    django.setup()
    fill(int(sys.argv[1]))
    found, seconds, cpu_s = asyncio.run(restore())
    print(json.dumps({"sessions": found, "seconds": seconds, "cpu_s": cpu_s}))
