"""A board of many rows, measured in a process and on a database of its own: prints JSON."""

from __future__ import annotations

import json
import random
import sys
import time
from collections.abc import Callable

PATIENTS = 300
TRIES = 5
BESIDE = 5_000  # patients of another clinic, whose board is built while somebody walks


def fill(count: int) -> None:
    """Make patients, a session each and its figures, in the database itself."""
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
    if connection.vendor == "sqlite":
        numbers = (
            "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {}) ".format
        )
        source = "n"
    else:
        numbers = "".format
        source = f"generate_series(1, {count - 1}) AS n(i)"
    # Hit rates of every whole percent, most of them around the middle.
    rate = "(i % 211 * 79 % 211 + i / 211 % 199 * 104 % 199) / 410.0"
    at = {"sqlite": "datetime('2026-11-21', '-' || (i % 1000000) || ' seconds')"}.get(
        connection.vendor, "timestamptz '2026-11-21' - (i % 1000000) * interval '1 second'"
    )

    def copy(model, which: str, changed: dict[str, str]) -> None:
        columns = [f.column for f in model._meta.concrete_fields if f.column != "id"]
        chosen = ", ".join(changed.get(column, f"t.{column}") for column in columns)
        table = model._meta.db_table
        with connection.cursor() as cursor:
            cursor.execute(
                f"INSERT INTO {table} (id, {', '.join(columns)}) {numbers(count - 1)}"  # noqa: S608
                f"SELECT {changed['id']}, {chosen} FROM {table} t, {source} WHERE {which}"
            )

    new = {"id": "900000000 + i"}
    text = "CAST(i AS varchar(12))"
    copy(
        Patient,
        f"t.id = {first.pk}",
        new | {"code": text, "pseudonym": text, "alias": text, "nickname": text},
    )
    copy(Consent, f"t.patient_id = {first.pk}", new | {"patient_id": "900000000 + i"})
    copy(
        TrainingSession,
        f"t.id = {walked.pk}",
        new | {"patient_id": "900000000 + i", "started_at": at},
    )
    for slug, value in (("hit_rate", rate), ("steps", "100 + i % 400")):
        base = 1_000_000_000 if slug == "steps" else 2_000_000_000
        copy(
            TrainingSession.metrics.rel.related_model,
            f"t.session_id = {walked.pk} AND t.slug = '{slug}'",
            {"id": f"{base} + i", "session_id": "900000000 + i", "value": value},
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
    )  # without the signal: it is built below, and timed


def measure(count: int) -> dict[str, float]:
    """Return what a look at the board takes [ms], and filling and building it [s]."""
    from django.utils import timezone

    from rehab.boards.building import entries
    from rehab.boards.models import BoardEntry, Leaderboard
    from rehab.boards.panels.viewer import BoardViewer
    from rehab.boards.ranking.standings import StoredStandings
    from rehab.people.models import Patient

    began = time.perf_counter()
    fill(count)
    filled = time.perf_counter()
    board = Leaderboard.everywhere.get()
    entries.refresh(board, now=timezone.now())
    entries.analyze_tables()
    built = time.perf_counter()
    assert BoardEntry.everywhere.count() == count
    draw = random.Random(7)
    patients = [900_000_000 + draw.randrange(1, count) for _ in range(PATIENTS)]
    found = {"rows": count, "fill_s": filled - began, "build_s": built - filled}

    def timed(name: str, look: Callable[[int], object]) -> None:
        """Look as each patient some times: the best look is what the board takes, all of them what
        it took beside whatever else ran on this machine.
        """
        best, every = [], []
        for patient in patients:
            took = []
            for _ in range(TRIES):
                start = time.perf_counter()
                look(patient)
                took.append(1000 * (time.perf_counter() - start))
            best.append(min(took))
            every += took
        for part in (50, 99):
            found[f"{name}_p{part}_ms"] = sorted(best)[len(best) * part // 100]
        found[f"{name}_p99_of_all_ms"] = sorted(every)[len(every) * 99 // 100]

    standings = StoredStandings(board, "")
    timed("count", lambda _: StoredStandings(board, ""))
    timed("top20", lambda _: standings.top(20))
    for ties in ("earlier", "dense", "standard"):
        board.ties = ties
        timed(f"own_{ties}", standings.find)
    placed = {patient: standings.find(patient) for patient in set(patients)}
    timed("neighbors", lambda patient: standings.around(placed[patient], 2))
    walkers = Patient.everywhere.select_related("clinic").in_bulk(patients)
    now = timezone.now()
    timed("whole_view", lambda patient: BoardViewer(board, now, walkers[patient]).make_panel())
    timed("one_more_session", lambda patient: entries.refresh(board, {patient}, now=now))
    found |= walk_while_one_is_built(patients=BESIDE)
    return {name: round(value, 3) for name, value in found.items()}


def walk_while_one_is_built(patients: int) -> dict[str, float]:
    """Build another board beside a session that is walked; return what its steps' commits take."""
    from datetime import UTC, datetime

    from rehab.boards.building import entries
    from rehab.boards.building.scheduler import BoardBuilder
    from rehab.boards.models import BoardEntry, Leaderboard
    from rehab.people.models import Clinic, Patient
    from rehab.sessions.live.session.aggregate import SessionAggregate
    from rehab.sessions.models import TrainingSession
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

    def commits(goes_on: Callable[[], bool]) -> list[float]:
        took: list[float] = []
        while goes_on():
            number = aggregate.fold.last_number + 1
            row = aggregate.record_step(Measurement(number, number * 1.1, Side.LEFT, 1.5), now)
            start = time.perf_counter()
            store(aggregate, [row])
            took.append(1000 * (time.perf_counter() - start))
            time.sleep(0.01)
        return sorted(took)

    alone = commits(lambda: aggregate.fold.last_number < 300)
    other = Clinic.everywhere.create(name="Other")
    moved = list(Patient.everywhere.order_by("-pk").values_list("pk", flat=True)[:patients])
    Patient.everywhere.filter(pk__gte=moved[-1]).update(clinic=other)
    TrainingSession.everywhere.filter(patient__gte=moved[-1]).update(clinic=other)
    board = Leaderboard(clinic=other, name="Other", among="clinic", aggregation="best")
    board.period, board.min_valid_strides, board.types = "all", 1, "all"
    Leaderboard.everywhere.bulk_create([board])
    entries.start_rebuild(board)
    builder = BoardBuilder()
    began = time.perf_counter()
    builder.wake()
    beside = commits(lambda: entries.find_unbuilt() is not None)
    seconds = time.perf_counter() - began
    assert BoardEntry.everywhere.filter(board=board).count() == len(moved)
    found = {"rebuild_beside_s": seconds, "beside_commits": float(len(beside))}
    for name, took in (("alone", alone), ("beside", beside)):
        found[f"commit_{name}_p50_ms"] = took[len(took) // 2]
        found[f"commit_{name}_p99_ms"] = took[len(took) * 99 // 100]
        found[f"commit_{name}_max_ms"] = took[-1]
    return found


def main(count: int) -> None:
    """Measure with so many rows."""
    import django
    from django.core.management import call_command

    django.setup()
    call_command("migrate", verbosity=0)
    print(json.dumps(measure(count)))


if __name__ == "__main__":
    main(int(sys.argv[1]))
