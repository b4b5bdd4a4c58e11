"""`manage.py upkeep hourly | nightly | weekly`: what keeps a server well, and a record of it.

Timers run it (deploy/systemd, deploy/compose.yaml). How each chore went is in /metrics.
"""

from __future__ import annotations

import ssl
from argparse import ArgumentParser
from collections.abc import Callable
from datetime import datetime, timedelta
from io import StringIO
from pathlib import Path
from typing import Any

from cryptography import x509
from django.conf import settings
from django.core.management import BaseCommand, CommandError, call_command
from django.utils import timezone

from rehab.management.commands.doctor import (
    Diagnosis,
    examine_keys,
    examine_new_steps,
    examine_seals,
)
from rehab.management.restore_test import restore_newest
from rehab.people.upkeep_runs import record_chore

NAMED = "garry-{:%Y-%m-%d}.backup"
RENEWED = timedelta(days=14)  # before a certificate ends; certbot does so 30 days before


def ship_logs(now: datetime) -> str:
    """Append what was sealed of the logs to the file stored elsewhere, if there is one."""
    if not settings.SHIPPED_LOGS:
        return "GARRY_SHIPPED_LOGS is not set: nothing is shipped."
    return _called("shiplogs", settings.SHIPPED_LOGS)


def retention(now: datetime) -> str:
    """Erase what clinics no longer keep."""
    return _called("retention")


def backup(now: datetime) -> str:
    """Write a backup, then delete those past their time."""
    folder = Path(_setting("GARRY_BACKUP_DIR", settings.BACKUP_DIR))
    said = _called("backup", folder / NAMED.format(now))
    oldest = NAMED.format(now - timedelta(days=settings.BACKUP_DAYS))
    for file in folder.glob("garry-*.backup"):
        if file.name < oldest:
            file.unlink()
    return said


def check_seals(now: datetime) -> str:
    """Compare logs with their seals, and the steps that were sealed lately."""
    return _examined(*examine_seals(), *examine_new_steps())


def check_keys(now: datetime) -> str:
    """Open the server's own keys."""
    return _examined(*examine_keys())


def check_certificate(now: datetime) -> str:
    """Read the certificate that the proxy shows."""
    host = settings.ALLOWED_HOSTS[0].lstrip(".")
    try:
        shown = ssl.get_server_certificate((host, 443), timeout=10)
    except OSError as problem:
        raise CommandError(f"No certificate at {host}:443 ({problem}).") from problem
    ends = x509.load_pem_x509_certificate(shown.encode()).not_valid_after_utc
    if ends - now < RENEWED:
        raise CommandError(f"The certificate of {host} ends on {ends:%Y-%m-%d}. Run certbot renew.")
    return f"The certificate of {host} is valid until {ends:%Y-%m-%d}."


def test_restore(now: datetime) -> str:
    """Restore the newest backup into a scratch database."""
    folder = Path(_setting("GARRY_BACKUP_DIR", settings.BACKUP_DIR))
    return restore_newest(folder, _setting("GARRY_RESTORE_KEY", settings.RESTORE_KEY))


CHORES: dict[str, Callable[[datetime], str]] = {
    "shiplogs": ship_logs,
    "retention": retention,
    "backup": backup,
    "seals": check_seals,
    "keys": check_keys,
    "certificate": check_certificate,
    "restore": test_restore,
}
TIMES = {
    "hourly": ["shiplogs"],
    "nightly": ["retention", "backup", "seals", "keys", "certificate"],
    "weekly": ["restore"],
}


class Command(BaseCommand):
    """Does each chore, whatever becomes of the others. Exits with status 1 where one failed."""

    help = "Do what keeps a server well; monitoring reads how it went."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the argument of what to do."""
        parser.add_argument("what", nargs="+", choices=[*TIMES, *CHORES])

    def handle(self, *args: Any, what: list[str], **options: Any) -> None:
        """Do the chores of a time, or these."""
        failed = False
        for name in [chore for one in what for chore in TIMES.get(one, [one])]:
            now, problem = timezone.now(), None
            try:
                said = CHORES[name](now)
            except Exception as error:  # the next chore is done all the same
                said = problem = f"{error}" or repr(error)
                failed = True
            record_chore(name, said, now, failed=problem is not None)
            (self.stdout if problem is None else self.stderr).write(f"{name}: {said.strip()}")
        if failed:
            raise SystemExit(1)


def _setting(name: str, value: str) -> str:
    if not value:
        raise CommandError(f"{name} is not set: see the page /help/hosting/.")
    return value


def _examined(*diagnoses: Diagnosis) -> str:
    """Return what `manage.py doctor` finds. Raises CommandError where something needs a cure."""
    bad = [f"{one.state}. {one.cure}" for one in diagnoses if one.cure]
    if bad:
        raise CommandError(f"{len(bad)} need care: {' '.join(bad[:5])}")
    return "; ".join(one.state for one in diagnoses)


def _called(*command: Any) -> str:
    out = StringIO()
    call_command(*command, stdout=out)
    return out.getvalue()
