"""The test of restored backups: the newest one in a scratch database, examined there."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from django.conf import settings
from django.core.management import CommandError

from rehab.people.commands import command


def restore_newest(folder: Path, key: str) -> str:
    """Restore the newest backup into a scratch database, and examine it there."""
    files = sorted(folder.glob("garry-*.backup"))
    if not files:
        raise CommandError(f"There is no backup to restore. Run {command('upkeep backup')}.")
    scratch = Path(tempfile.mkdtemp(prefix="restore-", dir=settings.DATA_DIR))
    try:
        said = _run_in(scratch, "restore", str(files[-1]), "--key", key)
        _run_in(scratch, "upkeep", "keys", "seals")
    finally:
        shutil.rmtree(scratch)
    return said.splitlines()[0]


def _run_in(folder: Path, *command: str) -> str:
    """Run a command of an installation in this folder, on SQLite. Raises CommandError."""
    own = {name: value for name, value in os.environ.items() if not name.startswith("GARRY_")}
    done = subprocess.run(
        [sys.executable, "-m", "garry_site", *command],
        cwd=settings.BASE_DIR,
        env=own | {"GARRY_DATA_DIR": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise CommandError((done.stderr or done.stdout).strip())
    return done.stdout
