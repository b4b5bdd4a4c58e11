"""How large a step is where it is kept and sent: the figures of docs/performance.md#sizes."""

from __future__ import annotations

import io
import json
from datetime import UTC, datetime, timedelta

import pytest
from django.db import connection

from rehab.sessions.log import Step
from rehab.sources.client import write_step
from rehab.training.steps import Measurement, Side
from tests.sessions.live import conftest as live
from tests.support.world import build_world

pytestmark = [pytest.mark.bench, pytest.mark.django_db(transaction=True)]

ROWS = 20_000
live_path, place, ready, begun = live.live_path, live.place, live.ready, live.begun  # fixtures


def make_rows(session, first):
    """Return steps as a session of half an hour has them: four figures beside each value."""
    began = datetime(2026, 5, 4, 9, tzinfo=UTC)
    extra = {"stance_s": 0.691234, "swing_s": 0.412345, "a2_sd_w_kg": 0.0312345, "belt": 0.81234}
    for number in range(first, first + ROWS):
        value = 3.5 + (number % 97) / 71
        yield Step(
            session=session,
            number=number,
            time_s=1.05 * number + 1 / 7,
            received_at=began + timedelta(seconds=1.05 * number),
            side="left",
            value=value,
            gain=1.0,
            shown=value,
            goal=3.9,
            performance=value / 3.9,
            hit=value >= 3.9,
            close=False,
            late=False,
            points=1,
            valid=True,
            phase=1,
            rules_version=3,
            extra=extra,
        )


def test_rows(capsys):
    """PostgreSQL's pages and indexes, after VACUUM; a batch of four as COPY writes them."""
    if connection.vendor != "postgresql":
        pytest.skip("needs GARRY_DATABASE_URL=postgres://…")
    session = build_world("amber").session
    Step.everywhere.bulk_create(make_rows(session, 1000), batch_size=1000)
    with connection.cursor() as cursor:
        cursor.execute("VACUUM FULL rehab_step")
        cursor.execute(
            "SELECT pg_relation_size('rehab_step'), pg_indexes_size('rehab_step'), count(*)"
            " FROM rehab_step"
        )
        heap, indexes, rows = cursor.fetchone()
    with capsys.disabled():
        print(f"\nrow {heap / rows:.0f} bytes, its indexes {indexes / rows:.0f}")


def test_parquet(capsys):
    """As the export for analysis writes it, compressed by zstd."""
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    names = [field.attname for field in Step._meta.concrete_fields if field.name != "id"]
    rows = [{name: getattr(step, name) for name in names} for step in make_rows(None, 1)]
    for row in rows:
        row["extra"], row["reasons"] = json.dumps(row["extra"]), json.dumps(row["reasons"])
    file = io.BytesIO()
    parquet.write_table(arrow.Table.from_pylist(rows), file, compression="zstd")
    with capsys.disabled():
        print(f"\nParquet {len(file.getvalue()) / ROWS:.0f} bytes a step")


async def test_frames(place, begun, capsys):
    """What a step is as text, for each who hears of it."""
    session = await begun(place)
    tablet, monitor, robot = place.tablet(session), place.monitor(session), place.robot()
    await tablet.watch()
    await monitor.watch()
    await (await robot.dial()).hello()
    source = await place.source().dial()
    await source.hello()
    extra = {"stance_s": 0.691234, "swing_s": 0.412345, "a2_sd_w_kg": 0.0312345, "belt": 0.81234}
    stride = Measurement(number=1, time_s=1234.567, side=Side.LEFT, value=3.912345, extra=extra)
    step = {"type": "step"} | write_step(stride, 1)
    await source.say(step)
    await source.acked(1)
    await tablet.until_step(1)
    await monitor.until_step(1)
    await robot.overhear()
    heard = {
        "source": step,
        "tablet": tablet.last("step"),
        "monitor": monitor.last("step"),
        "robot": next(message for message in robot.heard if message["type"] == "step"),
    }
    with capsys.disabled():
        for whom, message in heard.items():
            print(f"\n{whom} {len(json.dumps(message, separators=(',', ':')))} bytes")
