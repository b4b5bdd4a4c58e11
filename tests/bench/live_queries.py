"""Every query of the live path at ten million steps, on a database of its own: prints JSON."""

from __future__ import annotations

import json
import re
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

from tests.bench.own_database import copy_rows, set_up

WALKED = 1800  # steps a session: half an hour
EVENTS = 60  # a session
OPEN = 100  # sessions that run
CLINICS = 1_000  # beside theirs
GROWING = ("rehab_step", "rehab_sessionevent", "rehab_trainingsession", "rehab_sessionmetric")
BASE = 1_000_000  # keys of what is made begin there


def fill(rows: int) -> list[int]:
    """Make so many steps in the database itself; return the keys of the sessions that run."""
    from django.db import connection, transaction
    from django.utils import timezone

    from rehab.people.models import Clinic
    from rehab.sessions.live.session.aggregate import SessionAggregate
    from rehab.sessions.log import Remark, SessionEvent, Step
    from rehab.sessions.models import TrainingSession
    from rehab.sessions.ownership import ClinicOwner
    from rehab.training.steps import Measurement, Side
    from tests.support.live_seed import seed
    from tests.support.world import store

    key = seed(1)[0]["session"]
    aggregate = SessionAggregate.load(TrainingSession.everywhere.get(pk=key))
    at = timezone.now()
    with transaction.atomic():
        for number in range(1, WALKED + 1):
            row = aggregate.record_step(Measurement(number, number * 1.1, Side.LEFT, 3.0), at)
            store(aggregate, [row])
            if number % (WALKED // EVENTS) == 0:
                store(aggregate, [aggregate.log_event(Remark.HANDRAIL, None, at, {})])
    TrainingSession.everywhere.filter(pk=key).update(last_number=WALKED, **aggregate.summary())
    others = Clinic.everywhere.bulk_create(Clinic(name=f"other {n}") for n in range(CLINICS))
    ClinicOwner.everywhere.bulk_create(ClinicOwner(clinic=clinic) for clinic in others)
    count = max(OPEN, rows // WALKED)
    new = {"session_id": f"{BASE} + i"}
    state = f"CASE WHEN i <= {OPEN} THEN 'running' ELSE 'finished' END"
    sessions = {"id": f"{BASE} + i", "state": state, "station_id": "NULL"}
    copy_rows(TrainingSession, count, f"t.id = {key}", sessions)
    for model in (Step, SessionEvent):
        copy_rows(model, count, f"t.session_id = {key}", new)
    with connection.cursor() as cursor:
        cursor.execute("ANALYZE")
    return [BASE + index for index in range(1, OPEN + 1)]


def ask(keys: list[int]) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Give what the live path asks of a database, by what it is for."""
    from asgiref.sync import async_to_sync
    from django.utils import timezone

    from rehab.sessions.live import auth
    from rehab.sessions.live.database import clinic_owners
    from rehab.sessions.live.protocol import past_steps, resent_steps
    from rehab.sessions.live.session import loading
    from rehab.sessions.live.session.commit_transaction import Job, commit
    from rehab.sessions.models import TrainingSession
    from rehab.stations.models import Device
    from rehab.training.changes import Change, ChangeKind
    from rehab.training.measures import Measure
    from rehab.training.steps import Measurement, Side

    yield "find_ownerless", clinic_owners.find_ownerless
    clinic = TrainingSession.everywhere.get(pk=keys[0]).clinic_id
    epoch = clinic_owners.claim(clinic).epoch
    found = loading.load_together({keys[0]: epoch})[keys[0]]
    assert isinstance(found, loading.LoadedSession), found
    aggregate = found.aggregate
    yield "load one", lambda: loading.load_together({keys[1]: epoch})
    yield "load fifty", lambda: loading.load_together(dict.fromkeys(keys[2:52], epoch))

    def job(rows: Any, summary: Any = None) -> Job:
        session = aggregate.session
        return Job(aggregate, session.pk, epoch, rows, summary, lambda _: None)

    def step() -> Any:
        number = aggregate.fold.last_number + 1
        return aggregate.record_step(
            Measurement(number, number * 1.1, Side.LEFT, 3.0), timezone.now()
        )

    yield "commit a step", lambda: commit([job([step()])])
    yield (
        "commit with a checkpoint",
        lambda: commit([job([step()], aggregate.summary(with_checkpoint=True))]),
    )
    pause = Change(ChangeKind.PAUSE, "")
    yield (
        "commit a change",
        lambda: commit([job(aggregate.change(pause, None, timezone.now()), aggregate.summary())]),
    )
    yield "a page's past steps", lambda: async_to_sync(past_steps.read_backlog)(keys[0], 900, 1800)
    resent, measure = Measurement(900, 990.0, Side.LEFT, 3.0), aggregate.fold.plan.measure
    assert isinstance(measure, Measure)
    yield (
        "a step that came again",
        lambda: async_to_sync(resent_steps.check_same)(keys[0], resent, measure, 1),
    )
    device = Device.everywhere.filter(kind=Device.Kind.SOURCE)[0]
    tablet = Device.everywhere.filter(kind=Device.Kind.TABLET)[0]
    yield "a station's open session", lambda: async_to_sync(auth.find_open_session)(device, None)
    yield "its newest", lambda: loading.find_newest_open(device.station_id)
    yield "may a tablet open it", lambda: async_to_sync(auth.may_open)(tablet, keys[0])
    yield "note ends", lambda: clinic_owners.note_ends(keys[:52])
    yield "release", lambda: clinic_owners.release([clinic])


def measure(rows: int) -> dict[str, Any]:
    """Return how long each takes [ms], and the plans that walk through a table that grows."""
    from django.db import connection
    from django.test.utils import CaptureQueriesContext

    began = time.perf_counter()
    keys = fill(rows)
    found: dict[str, Any] = {"fill_s": round(time.perf_counter() - began, 1), "ms": {}}
    scans, asked_in_all = [], 0
    for name, work in ask(keys):
        with CaptureQueriesContext(connection) as asked:
            start = time.perf_counter()
            work()
            found["ms"][name] = round(1000 * (time.perf_counter() - start), 1)
        for query in asked.captured_queries:
            if query["sql"].startswith(("SELECT", "UPDATE")):
                asked_in_all += 1
                scans += [f"{name}: {scan}" for scan in _find_scans(query["sql"])]
    return found | {"queries": asked_in_all, "scans": scans}


def _find_scans(sql: str) -> list[str]:
    """Return where a query reads the whole of a table that grows."""
    from django.db import connection

    is_sqlite = connection.vendor == "sqlite"
    with connection.cursor() as cursor:
        cursor.execute(f"EXPLAIN {'QUERY PLAN ' if is_sqlite else ''}{sql}")
        plan = [str(row[3] if is_sqlite else row[0]) for row in cursor.fetchall()]
    pattern = r"\bSCAN (\w+)" if is_sqlite else r"Seq Scan on (\w+)"
    return [line for line in plan if (match := re.search(pattern, line)) and match[1] in GROWING]


if __name__ == "__main__":
    set_up()
    print(json.dumps(measure(int(sys.argv[1]))))
