"""An export of many strides, in a process and on a database of its own: prints JSON."""

from __future__ import annotations

import json
import resource
import sys
import time
from pathlib import Path
from typing import Any

STRIDES_EACH = 2_000  # of a session: half an hour of walking with both legs


def fill(sessions: int) -> None:
    """Walk one session by the real rules, and copy it in the database itself."""
    from django.db import connection

    from rehab.people.models import Clinic, Patient
    from rehab.sessions.log import SessionEvent, Step
    from rehab.sessions.models import TrainingSession
    from tests.support.walks import strides, walk

    clinic = Clinic.everywhere.create(name="Large")
    patient = Patient.everywhere.create(
        clinic=clinic, code="0", nickname="0", paretic_side="left", simulated=True
    )
    walked = walk(patient, "positive", strides(STRIDES_EACH // 2, STRIDES_EACH // 2))

    def copy(model: Any, key: str, changed: dict[str, str]) -> None:
        columns = [f.column for f in model._meta.concrete_fields if f.column != "id"]
        chosen = ", ".join(changed.get(column, f"t.{column}") for column in columns)
        table = model._meta.db_table
        with connection.cursor() as cursor:
            cursor.execute(
                f"INSERT INTO {table} (id, {', '.join(columns)}) WITH RECURSIVE n(i) AS "  # noqa: S608
                f"(SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {sessions - 1}) "
                f"SELECT {changed['id']}, {chosen} FROM {table} t, n WHERE t.{key} = {walked.pk}"
            )

    copy(TrainingSession, "id", {"id": "900000 + i"})
    for model in (Step, SessionEvent):
        copy(
            model,
            "session_id",
            {"id": "1000000 + i * 100000 + t.id", "session_id": "900000 + i"},
        )


def own_memory_mb() -> float:
    """Return the memory that is this process's own now.

    SQLite also maps up to 128 MB of its file (garry_site/settings.py), which counts in RSS and is
    the system's cache.
    """
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("RssAnon:"):
            return int(line.split()[1]) / 1024
    return 0.0


def measure(sessions: int, folder: Path) -> dict[str, float]:
    """Return how long an export takes [s], its size [MB], and the most memory it took [MB]."""
    from django.utils import timezone

    from rehab.exports.archive import write_zip
    from rehab.exports.research.package import Package
    from rehab.people.models import Clinic, User
    from rehab.people.roles import Role

    fill(sessions)
    user = User.everywhere.create_user("r", role=Role.LEAD, clinic=Clinic.everywhere.get())
    began = time.perf_counter()
    package = Package.create(folder / "x", user, None, shift_dates=True, now=timezone.now())
    own = max(own_memory_mb() for _ in package.advance(1e9))
    written = time.perf_counter()
    size = 0
    for chunk in write_zip(package.files()):
        size += len(chunk)
        own = max(own, own_memory_mb())
    return {
        "strides": sessions * STRIDES_EACH,
        "write_s": written - began,
        "archive_s": time.perf_counter() - written,
        "archive_mb": size / 1e6,
        "peak_own_mb": own,
        "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


if __name__ == "__main__":
    import django
    from django.core.management import call_command

    django.setup()
    call_command("migrate", verbosity=0)
    print(json.dumps(measure(int(sys.argv[1]), Path(sys.argv[2]))))
