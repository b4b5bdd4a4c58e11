"""`manage.py doctor`: says how this installation is, and what to do about what is not well."""

from __future__ import annotations

import asyncio
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from datetime import timedelta
from statistics import median
from typing import Any, NamedTuple

from channels.layers import get_channel_layer
from django.conf import settings
from django.contrib.staticfiles import finders
from django.core.checks import run_checks
from django.core.management import BaseCommand
from django.db import DatabaseError, connection
from django.db.migrations.executor import MigrationExecutor
from django.utils import timezone

from rehab.sessions.live import owners
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Device
from rehab.training.changes import State

SLOW_DISK_S = 0.05


class Finding(NamedTuple):
    """One thing that was looked at. ``cure`` is empty where all is well."""

    subject: str
    state: str
    cure: str = ""


class Command(BaseCommand):
    """Looks at database, layer, files, sessions, children and tokens."""

    help = "Explain the state of this installation, with cures."
    requires_system_checks: list[str] = []

    def handle(self, *args: Any, **options: Any) -> None:
        """Print the findings. Ends with status 1 where something needs a cure."""
        findings = [finding for look in LOOKS for finding in examine(look)]
        for finding in findings:
            mark = "needs care" if finding.cure else "well"
            self.stdout.write(f"{finding.subject:<12} {mark:<11} {finding.state}")
            if finding.cure:
                self.stdout.write(f"{'':<24} → {finding.cure}")
        if any(finding.cure for finding in findings):
            raise SystemExit(1)


def examine(look: Callable[[], Iterator[Finding]]) -> list[Finding]:
    """Look at one thing; that it cannot be looked at is a finding too."""
    try:
        return list(look())
    except (DatabaseError, OSError) as problem:
        subject = look.__name__.removeprefix("look_at_")
        return [Finding(subject, str(problem).strip(), "Mend the database first, then ask again.")]


def look_at_settings() -> Iterator[Finding]:
    """Give what the system checks complain of."""
    complaints = run_checks(include_deployment_checks=settings.HOSTED)
    for complaint in complaints:
        yield Finding(
            "settings", f"{complaint.id}: {complaint.msg}", complaint.hint or "See above."
        )
    if not complaints:
        yield Finding("settings", "no check complains")


def look_at_database() -> Iterator[Finding]:
    """Give the state of database and disk."""
    executor = MigrationExecutor(connection)
    pending = len(executor.migration_plan(executor.loader.graph.leaf_nodes()))
    kind = f"{connection.vendor}, {connection.settings_dict['NAME']}"
    if pending:
        yield Finding("database", f"{kind}: {pending} migration(s) to do", "Run manage.py migrate.")
    else:
        yield Finding("database", f"{kind}: up to date")
    took_s = fsync_s()
    state = f"a write reaches the disk in {1000 * took_s:.1f} ms (median of 20)"
    slow = took_s > SLOW_DISK_S
    yield Finding("disk", state, "Move GARRY_DATA_DIR to a faster disk." if slow else "")


def fsync_s() -> float:
    """Give how long a small write takes to reach the disk of the data folder."""
    times = []
    with tempfile.TemporaryFile(dir=settings.DATA_DIR) as file:
        for _ in range(20):
            began = time.perf_counter()
            file.write(b"x" * 4096)
            file.flush()
            os.fsync(file.fileno())
            times.append(time.perf_counter() - began)
    return median(times)


def look_at_layer() -> Iterator[Finding]:
    """Give whether server processes reach each other."""
    if not settings.REDIS_URL:
        yield Finding("layer", "in memory: one server process")
        return
    try:
        asyncio.run(ping_layer())
    except Exception as problem:
        yield Finding("layer", f"Redis does not answer: {problem}", "Check GARRY_REDIS_URL.")
    else:
        yield Finding("layer", "Redis carries messages")


async def ping_layer() -> None:
    """Send a message through the layer and back. Raises where it does not come."""
    layer: Any = get_channel_layer()
    name = await layer.new_channel()
    await layer.send(name, {"type": "ping"})
    await asyncio.wait_for(layer.receive(name), 3)


def look_at_files() -> Iterator[Finding]:
    """Give whether pages find their files."""
    missing = [name for name in ("css/shared/tokens.css", "img/mark.svg") if not finders.find(name)]
    missing += [name for name, folder in settings.BROWSER_LIBRARIES.items() if not folder.is_dir()]
    if missing:
        yield Finding("files", f"missing: {', '.join(missing)}", "Run make setup.")
    elif settings.HOSTED and not (settings.STATIC_ROOT / "staticfiles.json").exists():
        yield Finding("files", "not collected", "Run manage.py collectstatic.")
    else:
        yield Finding("files", "all there")


def look_at_sessions() -> Iterator[Finding]:
    """Give the sessions that run, and those that a dead process left running."""
    running = list(TrainingSession.everywhere.filter(state=State.RUNNING.value))
    left = [s.pk for s in running if not s.owner or not owners.is_alive(s.owner)]
    if left:
        yield Finding(
            "sessions",
            f"{len(left)} left running by a process that is gone: "
            f"{', '.join(map(str, left[:10]))}{' …' if len(left) > 10 else ''}",
            "Start the server: it pauses them, with all their steps.",
        )
    yield Finding(
        "sessions",
        f"{len(running) - len(left)} running, {TrainingSession.everywhere.count()} in all",
    )


def look_at_children() -> Iterator[Finding]:
    """Give the processes that the server keeps up."""
    report = settings.DATA_DIR / "children.json"
    if not report.exists():
        yield Finding("children", "none")
        return
    told = json.loads(report.read_text())
    if not told["children"]:
        yield Finding("children", "none")
    for child in told["children"]:
        state = f"{child['name']}: {child['state']}, restarted {child['restarts']} times"
        failed = child["state"] == "failed"
        last = "; ".join(child["last_words"]) or "it said nothing"
        yield Finding("children", state, f"Its last words: {last}" if failed else "")


def look_at_tokens() -> Iterator[Finding]:
    """Give the devices that may dial in."""
    devices = Device.everywhere.filter(revoked_at__isnull=True)
    for kind, label in Device.Kind.choices:
        of_kind = devices.filter(kind=kind)
        never = of_kind.filter(last_seen_at__isnull=True).count()
        yield Finding("tokens", f"{label}: {of_kind.count()} valid, {never} never used")
    month = timezone.now() - timedelta(days=90)
    stale = devices.filter(last_seen_at__lt=month).count()
    if stale:
        yield Finding("tokens", f"{stale} not used for 90 days", "Revoke what is not needed.")


LOOKS: tuple[Callable[[], Iterator[Finding]], ...] = (
    look_at_settings,
    look_at_database,
    look_at_layer,
    look_at_files,
    look_at_sessions,
    look_at_children,
    look_at_tokens,
)
