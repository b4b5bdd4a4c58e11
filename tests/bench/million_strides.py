"""An export of many strides, in a process and on a database of its own: prints JSON."""

from __future__ import annotations

import json
import resource
import sys
import time
from pathlib import Path

from tests.bench.own_database import copy_rows, set_up

STRIDES_EACH = 2_000  # of a session: half an hour of walking with both legs


def fill(sessions: int) -> None:
    """Walk one session by the real rules, and copy it in the database itself."""
    from rehab.people.models import Clinic, Patient
    from rehab.sessions.log import SessionEvent, Step
    from rehab.sessions.models import TrainingSession
    from tests.support.walks import strides, walk

    clinic = Clinic.everywhere.create(name="Large")
    patient = Patient.everywhere.create(
        clinic=clinic, code="0", nickname="0", paretic_side="left", simulated=True
    )
    walked = walk(patient, "positive", strides(STRIDES_EACH // 2, STRIDES_EACH // 2))

    copy_rows(TrainingSession, sessions - 1, f"t.id = {walked.pk}", {"id": "900000 + i"})
    for model in (Step, SessionEvent):
        new = {"id": "1000000 + i * 100000 + t.id", "session_id": "900000 + i"}
        copy_rows(model, sessions - 1, f"t.session_id = {walked.pk}", new)


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
    from rehab.exports.research.resumable_export import Package
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
    set_up()
    print(json.dumps(measure(int(sys.argv[1]), Path(sys.argv[2]))))
