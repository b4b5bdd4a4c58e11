"""A board of many sessions, measured in a process and on a database of its own: prints JSON."""

from __future__ import annotations

import json
import random
import resource
import sys
import threading
import time
from itertools import chain
from typing import Any

from tests.bench.own_database import copy_rows, set_up

COMMITS = 300
LOOKS = 200  # of other patients each
TRIES = 5  # of each: the best is what it takes, the others also wait for what else runs here


def fill(count: int, patients: int) -> None:
    """Make patients, their sessions and figures, in the database itself."""
    from django.db import connection

    from rehab.boards.models import Leaderboard
    from rehab.people.consent.models import Consent
    from rehab.people.models import Clinic, Patient
    from rehab.sessions.models import TrainingSession
    from tests.support.walks import strides, walk
    from tests.support.world import agreeing

    clinic = Clinic.everywhere.create(name="Large")
    first = agreeing(
        Patient.everywhere.create(
            clinic=clinic, code="0", nickname="0", paretic_side="left", boards="clinic"
        )
    )
    walked = walk(first, "positive", strides(2, 1))
    TrainingSession.everywhere.filter(pk=walked.pk).update(plan={})
    # Hit rates of every whole percent, most of them around the middle.
    rate = "(i % 211 * 79 % 211 + i / 211 % 199 * 104 % 199) / 410.0"
    at = {"sqlite": "datetime('2026-11-21', '-' || (i % 1000000) || ' seconds')"}.get(
        connection.vendor, "timestamptz '2026-11-21' - (i % 1000000) * interval '1 second'"
    )

    new = {"id": "900000000 + i"}
    text = "CAST(i AS varchar(12))"
    copy_rows(
        Patient,
        patients,
        f"t.id = {first.pk}",
        new | {"code": text, "pseudonym": text, "alias": text, "nickname": text},
    )
    copy_rows(
        Consent, patients, f"t.patient_id = {first.pk}", new | {"patient_id": "900000000 + i"}
    )
    copy_rows(
        TrainingSession,
        count,
        f"t.id = {walked.pk}",
        new | {"patient_id": f"900000001 + i % {patients}", "started_at": at},
    )
    values = {"hit_rate": rate, "steps": "100 + i % 400", "active_minutes": "10 + i % 20"}
    for number, (slug, value) in enumerate(values.items(), start=1):
        copy_rows(
            TrainingSession.metrics.rel.related_model,
            count,
            f"t.session_id = {walked.pk} AND t.slug = '{slug}'",
            {"id": f"{number}000000000 + i", "session_id": "900000000 + i", "value": value},
        )
    with connection.cursor() as cursor:
        cursor.execute("ANALYZE")
    Leaderboard.everywhere.bulk_create(
        [
            Leaderboard(
                clinic=clinic,
                name="Large",
                among="clinic",
                aggregation="best",
                period="all",
                min_valid_strides=1,
                types="all",
                top_n=20,
            )
        ]
    )


def measure(count: int, patients: int) -> dict[str, float]:
    """Return what the first look at a board takes [s], and later ones [ms]."""
    from django.utils import timezone

    from rehab.boards.cache_invalidation import record_changes
    from rehab.boards.models import Leaderboard
    from rehab.boards.panels.shared_panels import BoardViewer
    from rehab.people.models import Patient

    began = time.perf_counter()
    fill(count, patients)
    filled = time.perf_counter()
    board = Leaderboard.everywhere.select_related("clinic").get()
    walkers = Patient.everywhere.select_related("clinic").in_bulk(
        random.Random(7).sample(range(900_000_001, 900_000_001 + patients), LOOKS)
    )
    found = {"sessions": float(count), "patients": float(patients), "fill_s": filled - began}

    def look(patient: Patient) -> float:
        start = time.perf_counter()
        panel = BoardViewer(board, timezone.now(), patient).make_panel()
        assert panel.rows
        return 1000 * (time.perf_counter() - start)

    def look_after_a_session(patient: Patient) -> float:
        record_changes({patient.pk})
        return look(patient)

    cpu = time.process_time()
    found["first_look_s"] = look(next(iter(walkers.values()))) / 1000
    found["first_look_cpu_s"] = time.process_time() - cpu
    for display in ("neighbors", "top_and_me"):
        board.display = display
        for name, timed in (("look", look), ("look_after_a_session", look_after_a_session)):
            took = [[timed(patient) for _ in range(TRIES)] for patient in walkers.values()]
            best, every = sorted(map(min, took)), sorted(chain(*took))
            for part in (50, 99):
                found[f"{display}_{name}_p{part}_ms"] = best[LOOKS * part // 100]
            found[f"{display}_{name}_p99_of_all_ms"] = every[len(every) * 99 // 100]
    found["memory_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    found |= walk_beside_a_first_look(board)
    return {name: round(value, 3) for name, value in found.items()}


def walk_beside_a_first_look(board: Any) -> dict[str, float]:
    """Walk a session while others look at a board for the first time; time its steps' commits."""
    from datetime import UTC, datetime

    from django.db import connection

    from rehab.boards.cache import clear_cache, read_lists
    from rehab.people.models import Patient
    from rehab.sessions.live.session.aggregate import SessionAggregate
    from rehab.sessions.services import SessionRequest, create_session
    from rehab.training.changes import Change, ChangeKind
    from rehab.training.goals import GoalRule
    from rehab.training.phases import make_phase
    from rehab.training.steps import Measurement, Side
    from tests.support.world import store

    walker = Patient.everywhere.order_by("pk")[0]
    phases = (make_phase("training"),)
    session = create_session(
        SessionRequest(patient=walker, valence="binary", goal=GoalRule(value=1.0), phases=phases)
    )
    aggregate, now = SessionAggregate(session), datetime.now(UTC)
    store(aggregate, aggregate.change(Change(ChangeKind.START), None, now))
    looking = threading.Event()

    def commits() -> list[float]:
        took: list[float] = []
        while len(took) < COMMITS:
            number = aggregate.fold.last_number + 1
            row = aggregate.record_step(Measurement(number, number * 1.1, Side.LEFT, 1.5), now)
            start = time.perf_counter()
            store(aggregate, [row])
            took.append(1000 * (time.perf_counter() - start))
            time.sleep(0.01)
        return sorted(took)

    def look() -> None:
        while not looking.is_set():
            clear_cache()
            read_lists(board, now)
        connection.close()

    found: dict[str, float] = {}
    alone = commits()
    thread = threading.Thread(target=look)
    thread.start()
    beside = commits()
    looking.set()
    thread.join()
    for name, took in (("alone", alone), ("beside", beside)):
        found[f"commit_{name}_p50_ms"] = took[len(took) // 2]
        found[f"commit_{name}_p99_ms"] = took[len(took) * 99 // 100]
        found[f"commit_{name}_max_ms"] = took[-1]
    return found


if __name__ == "__main__":
    set_up()
    print(json.dumps(measure(*map(int, sys.argv[1:]))))
