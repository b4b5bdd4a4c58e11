"""`manage.py doctor`: the state of this installation, with a cure for each problem."""

from __future__ import annotations

import json
import os
import tempfile
import time
from argparse import ArgumentParser
from collections.abc import Callable, Iterable, Iterator
from datetime import datetime, timedelta
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from django.conf import settings
from django.contrib.staticfiles import finders
from django.core.checks import run_checks
from django.core.management import BaseCommand
from django.db import DatabaseError, connection
from django.utils import timezone

from rehab.exports.research.sinks import FORMATS
from rehab.gait.recordings.readers import READERS
from rehab.management.files import new_file
from rehab.management.problem_report import write_report
from rehab.people.audit import append_only_triggers, seals
from rehab.people.audit.seals import LogSeal
from rehab.people.commands import command, reinstall
from rehab.people.server_keys import ServerKey
from rehab.people.sign_in.first_start import count_pending_migrations
from rehab.people.upkeep_runs import TASK, Chore
from rehab.sessions import seals as session_seals
from rehab.sessions.live.database import clinic_owners
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log_fold import DamagedLog, check_log
from rehab.sessions.models import TrainingSession
from rehab.sources import SOURCES
from rehab.stations.models import Device
from rehab.training.changes import OPEN_STATES, State
from rehab.training.measures import MEASURES
from robot.bases import BASES
from robot.motion.gestures import GESTURES
from robot.plugins import Registry

REGISTRIES: tuple[Registry[Any], ...] = (SOURCES, READERS, MEASURES, BASES, GESTURES, FORMATS)
SLOW_DISK_S = 0.05
SEALED_SINCE = timedelta(days=30)  # whose rows are read again without --deep


class Diagnosis(NamedTuple):
    """The state of one thing. ``cure`` is empty where all is well."""

    subject: str
    state: str
    cure: str = ""


class Command(BaseCommand):
    """Examines settings, database, files, sessions, child processes and tokens."""

    help = "Explain the state of this installation, with cures."
    requires_system_checks: list[str] = []

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the options."""
        parser.add_argument(
            "--deep",
            action="store_true",
            help="also fold the logs of all open sessions again, and compare all steps with seals",
        )

        parser.add_argument(
            "--report",
            type=Path,
            metavar="FILE",
            help="also write FILE, to report a problem with: no patient, name or key is in it",
        )

    def handle(
        self, *args: Any, deep: bool = False, report: Path | None = None, **options: Any
    ) -> None:
        """Print the diagnoses. Exits with status 1 where something needs a cure."""
        last = (examine_session_logs, examine_all_steps) if deep else (examine_new_steps,)
        diagnoses = diagnose(*last)
        for diagnosis in diagnoses:
            mark = "needs care" if diagnosis.cure else "well"
            self.stdout.write(f"{diagnosis.subject:<12} {mark:<11} {diagnosis.state}")
            if diagnosis.cure:
                self.stdout.write(f"{'':<24} → {diagnosis.cure}")
        if report is not None:
            with new_file(report) as out:
                out.write(report_of(diagnoses, timezone.now()).encode())
        if any(diagnosis.cure for diagnosis in diagnoses):
            raise SystemExit(1)


def examine(run: Callable[[], Iterator[Diagnosis]]) -> list[Diagnosis]:
    """Run one examination; its failure is a diagnosis too."""
    try:
        return list(run())
    except (DatabaseError, OSError) as problem:
        subject = run.__name__.removeprefix("examine_")
        return [
            Diagnosis(
                subject, str(problem).strip(), "Repair the database first, then run this again."
            )
        ]


def examine_settings() -> Iterator[Diagnosis]:
    """Diagnose the settings by the system checks."""
    found = run_checks(include_deployment_checks=settings.HOSTED)
    messages = [message for message in found if not message.is_silenced()]
    for message in messages:
        yield Diagnosis("settings", f"{message.id}: {message.msg}", message.hint or "See above.")
    if not messages:
        yield Diagnosis("settings", "no check complains")


def examine_database() -> Iterator[Diagnosis]:
    """Diagnose database and disk."""
    pending = count_pending_migrations()
    kind = f"{connection.vendor}, {connection.settings_dict['NAME']}"
    if pending:
        yield Diagnosis(
            "database", f"{kind}: {pending} migration(s) to do", f"Run {command('migrate')}."
        )
    else:
        yield Diagnosis("database", f"{kind}: up to date")
    took_s = fsync_s()
    state = f"a write reaches the disk in {1000 * took_s:.1f} ms (median of 20)"
    slow = took_s > SLOW_DISK_S
    yield Diagnosis("disk", state, "Move GARRY_DATA_DIR to a faster disk." if slow else "")


def fsync_s() -> float:
    """Return the median time [s] that a small write takes to reach the data folder's disk."""
    times = []
    with tempfile.TemporaryFile(dir=settings.DATA_DIR) as file:
        for _ in range(20):
            began = time.perf_counter()
            file.write(b"x" * 4096)
            file.flush()
            os.fsync(file.fileno())
            times.append(time.perf_counter() - began)
    return median(times)


def examine_files() -> Iterator[Diagnosis]:
    """Diagnose the static files."""
    missing = [name for name in ("css/shared/tokens.css", "img/mark.svg") if not finders.find(name)]
    missing += [name for name, folder in settings.BROWSER_LIBRARIES.items() if not folder.is_dir()]
    if missing:
        yield Diagnosis("files", f"missing: {', '.join(missing)}", f"Run {reinstall()}.")
    elif settings.HOSTED and not (settings.STATIC_ROOT / "staticfiles.json").exists():
        yield Diagnosis("files", "not collected", f"Run {command('collectstatic')}.")
    else:
        yield Diagnosis("files", "all there")


def examine_sessions() -> Iterator[Diagnosis]:
    """Diagnose running sessions, among them those of a process that no longer exists."""
    running = TrainingSession.everywhere.filter(state=State.RUNNING.value)
    clinics, _ = clinic_owners.find_ownerless()
    left = list(running.filter(clinic__in=clinics).order_by("pk").values_list("pk", flat=True))
    if left:
        yield Diagnosis(
            "sessions",
            f"{len(left)} left running by a process that is gone: "
            f"{', '.join(map(str, left[:10]))}{' …' if len(left) > 10 else ''}",
            "Start the server: it pauses them, with all their steps.",
        )
    yield Diagnosis(
        "sessions",
        f"{running.count() - len(left)} running, {TrainingSession.everywhere.count()} in all",
    )


def examine_session_logs() -> Iterator[Diagnosis]:
    """Diagnose the logs of open sessions: whole, and the same by checkpoint as from their start."""
    states = [state.value for state in OPEN_STATES]
    faults = 0
    for session in TrainingSession.everywhere.filter(state__in=states).order_by("pk").iterator():
        try:
            check_log(session)
        except DamagedLog as problem:
            faults += 1
            yield Diagnosis("session logs", f"session {session.pk} lacks steps", str(problem))
            continue
        quick = SessionAggregate.load(session).fold
        session.checkpoint = None
        if vars(SessionAggregate.load(session).fold) != vars(quick):
            faults += 1
            yield Diagnosis(
                "session logs",
                f"session {session.pk} is another one by its checkpoint than by its log",
                "Stop the server, clear the session's checkpoint (it is not needed), start again, "
                "and report this.",
            )
    if not faults:
        yield Diagnosis("session logs", "whole, and the same by checkpoint as from their start")


def examine_plugins() -> Iterator[Diagnosis]:
    """Diagnose what other packages add; what cannot be loaded is left out, and named here."""
    plugins = [plugin for registry in REGISTRIES for plugin in registry.plugins]
    for one in plugins:
        about = f"{one.group} {one.name} of {one.package} {one.version}"
        cure = f"pip install --upgrade {one.package}, or pip uninstall {one.package}."
        yield Diagnosis(
            "plug-ins", f"{about}: {one.problem or 'in use'}", cure if one.problem else ""
        )
    if not plugins:
        yield Diagnosis("plug-ins", "none")


def examine_children() -> Iterator[Diagnosis]:
    """Diagnose the child processes of the server."""
    report = settings.DATA_DIR / "children.json"
    if not report.exists():
        yield Diagnosis("children", "none")
        return
    status = json.loads(report.read_text())
    if not status["children"]:
        yield Diagnosis("children", "none")
    for child in status["children"]:
        state = f"{child['name']}: {child['state']}, restarted {child['restarts']} times"
        failed = child["state"] == "failed"
        last = "; ".join(child["last_output"]) or "no output"
        yield Diagnosis("children", state, f"Its last words: {last}" if failed else "")


def examine_tasks() -> Iterator[Diagnosis]:
    """Diagnose what the server does by itself, while it runs and at night."""
    failed = [one for one in Chore.objects.all() if not one.is_well]
    for one in failed:
        cure = f"Mend that, then run {command(f'upkeep {one.name}')}."
        if one.name.startswith(TASK):
            cure = "Restart the server; where it fails again, its log says more: report that."
        # What it said may name a patient, and states stand in a problem report.
        state = f"{one.name} failed, {one.failed_at:%Y-%m-%d %H:%M} UTC"
        yield Diagnosis("tasks", state, f"It said: {one.said.strip()} {cure}")
    if not failed:
        yield Diagnosis("tasks", "none failed when it was last done")


def examine_tokens() -> Iterator[Diagnosis]:
    """Diagnose the tokens of devices."""
    devices = Device.everywhere.filter(revoked_at__isnull=True)
    for kind, label in Device.Kind.choices:
        of_kind = devices.filter(kind=kind)
        never = of_kind.filter(last_seen_at__isnull=True).count()
        yield Diagnosis("tokens", f"{label}: {of_kind.count()} valid, {never} never used")
    month = timezone.now() - timedelta(days=90)
    stale = devices.filter(last_seen_at__lt=month).count()
    if stale:
        yield Diagnosis("tokens", f"{stale} not used for 90 days", "Revoke what is not needed.")


def examine_seals() -> Iterator[Diagnosis]:
    """Diagnose the chains of the audit log and the history, and what keeps them append-only."""
    for name in append_only_triggers.find_missing(connection.alias):
        yield Diagnosis("logs", f"the trigger {name} is missing", f"Run {command('migrate')}.")
    broken = list(seals.find_broken())
    for problem in broken[:10]:
        cure = f"Compare with the copy of {command('shiplogs')}, and find out who was there."
        yield Diagnosis("logs", problem, cure)
    if not broken:
        late = seals.count_unsealed(timezone.now() - timedelta(days=1))
        state = f"{LogSeal.everywhere.count()} seals hold, {late} rows older than a day lack one"
        yield Diagnosis("logs", state, "Start the server: it seals them." if late else "")


def examine_keys() -> Iterator[Diagnosis]:
    """Diagnose the server's own keys."""
    stored = list(ServerKey.objects.all())
    closed = ", ".join(str(one) for one in stored if one.open() is None)
    cure = f"GARRY_SECRET_KEY is another one now: see {command('rotatekeys --help')}."
    if closed:
        yield Diagnosis("keys", f"{closed}: not opened", cure)
    else:
        yield Diagnosis("keys", f"all {len(stored)} open")


def examine_new_steps() -> Iterator[Diagnosis]:
    """Diagnose the seals of all sessions, and the steps and events that were sealed lately."""
    return _examine_steps(timezone.now() - SEALED_SINCE)


def examine_all_steps() -> Iterator[Diagnosis]:
    """Diagnose the seals of all sessions, and all their steps and events."""
    return _examine_steps(None)


def _examine_steps(since: datetime | None) -> Iterator[Diagnosis]:
    broken = list(session_seals.find_broken(since))
    for problem in broken[:10]:
        cure = "Compare with a backup from before, and find out who was there."
        yield Diagnosis("steps", problem, cure)
    if not broken:
        late = session_seals.count_late(timezone.now() - timedelta(days=1))
        state = "as they were sealed" + ("" if since is None else " in the last 30 days")
        cure = "Start the server: it seals them." if late else ""
        yield Diagnosis("steps", f"{state}; {late} sessions ended a day ago lack a seal", cure)


EXAMINATIONS: tuple[Callable[[], Iterator[Diagnosis]], ...] = (
    examine_settings,
    examine_database,
    examine_files,
    examine_sessions,
    examine_plugins,
    examine_children,
    examine_tasks,
    examine_tokens,
    examine_seals,
    examine_keys,
)


def diagnose(*more: Callable[[], Iterator[Diagnosis]]) -> list[Diagnosis]:
    """Return what the usual examinations find, and more of them."""
    return [diagnosis for run in (*EXAMINATIONS, *more) for diagnosis in examine(run)]


def report_of(diagnoses: Iterable[Diagnosis], now: datetime) -> str:
    """Return what a problem is reported with."""
    states = [(one.subject, one.state, bool(one.cure)) for one in diagnoses]
    plugins = [plugin for registry in REGISTRIES for plugin in registry.plugins]
    return write_report(states, plugins, now)
