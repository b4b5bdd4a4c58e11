"""`garry demo`: a clinic of simulated patients to look around in, made anew each day."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from argparse import ArgumentParser
from pathlib import Path
from types import FrameType
from typing import Any

from django.conf import settings
from django.core.management import BaseCommand, CommandError
from django.utils import timezone

from rehab.management.demo_clinic import fill_clinic
from rehab.people.random_codes import random_words
from rehab.people.roles import DEMO_ACCOUNTS
from rehab.people.sign_in.first_start import prepare_database

STOP_S = 20


class Command(BaseCommand):
    """Serves a demonstration from a folder of its own, which it empties again and again."""

    help = "Serve a simulated clinic with weeks of history, made anew at each start and each day."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the options."""
        parser.add_argument("--host", default=settings.HOST)
        parser.add_argument("--port", type=int, default=settings.PORT)
        parser.add_argument(
            "--hours", type=float, default=24.0, metavar="H", help="how long a clinic lasts"
        )
        parser.add_argument("--fill", action="store_true", help="only make the clinic, and end")

    def handle(
        self, *args: Any, host: str, port: int, hours: float, fill: bool, **options: Any
    ) -> None:
        """Make the clinic and serve it, until Ctrl-C. Raises CommandError where patients are."""
        if fill:
            if not settings.DEMO:
                raise CommandError("This fills a demonstration's own database: run garry demo.")
            prepare_database()
            fill_clinic(settings.DEMO, timezone.now())
            return
        if settings.HOSTED:
            raise CommandError("A hosted server has patients. Run the demonstration elsewhere.")
        folder, password = settings.DATA_DIR / "demo", random_words(3)
        environment = _environment(folder, password)
        self.stdout.write(f"Sign in as {', '.join(DEMO_ACCOUNTS)}; the password is {password}.")
        signal.signal(signal.SIGTERM, _interrupt)
        ended = None
        while ended is None:
            if folder.exists():
                shutil.rmtree(folder)
            self.stdout.write("Making the clinic with weeks of history: half a minute …")
            self.stdout.flush()  # at once, also into a file
            if _run(environment, "demo", "--fill").wait():
                raise CommandError("The clinic could not be made; the cause is above.")
            served = _run(environment, "serve", "--host", host, "--port", str(port))
            try:
                ended = served.wait(hours * 3600)
            except subprocess.TimeoutExpired:
                _end(served)
            except KeyboardInterrupt:
                ended = _end(served)
        raise SystemExit(ended)


def _environment(folder: Path, password: str) -> dict[str, str]:
    """Return the variables of the demonstration's server: its own folder, and nothing of ours."""
    own = ("GARRY_DATABASE_URL", "GARRY_SECRET_KEY", "GARRY_BACKUP_KEYS")
    rest = {name: value for name, value in os.environ.items() if name not in own}
    return rest | {"GARRY_DATA_DIR": str(folder), "GARRY_DEMO": password}


def _run(environment: dict[str, str], *command: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "garry_site", *command],
        env=environment,
        cwd=settings.BASE_DIR,
        stdin=subprocess.DEVNULL,
        start_new_session=True,  # a Ctrl-C is ours to pass on
    )


def _end(server: subprocess.Popen[bytes]) -> int:
    server.terminate()
    try:
        return server.wait(STOP_S)
    except subprocess.TimeoutExpired:
        server.kill()
        return server.wait()


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt
