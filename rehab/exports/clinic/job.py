"""A subcommand of `manage.py clinic` that a page starts: a process of its own, however long."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from django.conf import settings

from rehab.sessions.live.database import clinic_owners


class Job:
    """The latest subcommand of a clinic: whether it runs, what it said and wrote.

    Its folder goes a day after it, with exports that nobody fetched; the certificate stays.
    """

    def __init__(self, clinic_id: int) -> None:
        data = Path(settings.DATA_DIR)
        self.folder = data / "exports" / f"clinic-{clinic_id}"
        self.file = self.folder / "clinic.age"
        self.certificate = data / "certificates" / f"clinic-{clinic_id}.json"
        self._output, self._process = self.folder / "said.txt", self.folder / "process"

    @property
    def is_running(self) -> bool:
        """Whether its process runs, whichever server started it."""
        return self._process.exists() and clinic_owners.is_alive(self._process.read_text("utf-8"))

    @property
    def said(self) -> str:
        """What it said until now."""
        return self._output.read_text("utf-8", "replace") if self._output.exists() else ""

    def start(self, *arguments: str) -> None:
        """Start a subcommand, where none runs."""
        for folder in (self.folder, self.certificate.parent):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not self.is_running:
            with self._output.open("wb") as output:
                pid = run_aside([sys.executable, "-m", "garry_site", "clinic", *arguments], output)
            self._process.write_text(clinic_owners.process_name(pid), "utf-8")


def run_aside(command: Sequence[str], output: IO[bytes]) -> int:
    """Run a command as a process of its own; return its id."""
    process = subprocess.Popen(
        command,
        cwd=settings.BASE_DIR,
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )
    threading.Thread(target=process.wait, name="clinic", daemon=True).start()
    return process.pid
