"""A real server for tests: its own process, port and folder."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from tests.support import templates

ROOT = Path(__file__).parents[2]
SETTINGS = "garry_site.settings"


@dataclass
class Server:
    """A running `manage.py serve`."""

    port: int
    folder: Path
    process: subprocess.Popen[str]
    said: str

    @property
    def url(self) -> str:
        """Its address."""
        return f"http://127.0.0.1:{self.port}"

    def read_log(self) -> str:
        """Return what it wrote since its start, or since this was asked last."""
        assert self.process.stdout is not None
        pipe = self.process.stdout.fileno()
        os.set_blocking(pipe, False)
        written = b""
        with suppress(BlockingIOError):
            while part := os.read(pipe, 1 << 16):
                written += part
        return written.decode(errors="replace")

    def manage(self, *arguments: str) -> str:
        """Run a management command on its database; return what that prints."""
        return run_python(self.folder, "manage.py", *arguments, port=self.port)

    def run_shell(self, program: str) -> str:
        """Run a program with its rows; return what that prints."""
        return self.manage("shell", "-v0", "-c", program)

    @property
    def password(self) -> str:
        """The first account's password, as the server told it."""
        return self.said.split("with the password ")[1].split()[0]


def free_port() -> int:
    """Return a port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def clean_environment(folder: Path, port: int) -> dict[str, str]:
    """Return this process's environment with none of its GARRY settings."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("GARRY_")}
    return clean | {"GARRY_DATA_DIR": str(folder), "GARRY_PORT": str(port)}


def try_python(
    folder: Path, *arguments: str, port: int = 8000, umask: int = -1, **variables: Any
) -> subprocess.CompletedProcess[str]:
    """Run Python on a data folder, with our settings and these variables; return what became."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env=clean_environment(folder, port) | {"DJANGO_SETTINGS_MODULE": SETTINGS} | variables,
        capture_output=True,
        text=True,
        timeout=600,
        umask=umask,
    )


def run_python(folder: Path, *arguments: str, **options: Any) -> str:
    """Run Python on a data folder; return what it prints."""
    done = try_python(folder, *arguments, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@cache
def read_tables() -> bytes:
    """Return a database with the tables and no row of ours, as a server makes one at first."""
    if kept := templates.read("server"):
        return kept
    with tempfile.TemporaryDirectory() as folder:
        run_python(Path(folder), "manage.py", "migrate", "--verbosity", "0")
        database = Path(folder, "garry.sqlite3")
        assert not database.with_name("garry.sqlite3-wal").exists()  # all is in the file
        made = database.read_bytes()
    templates.keep("server", made)
    return made


@contextmanager
def serve(
    folder: Path,
    *arguments: str,
    new_machine: bool = False,
    settings: Mapping[str, str] | None = None,
    program: Sequence[str] = ("manage.py",),
) -> Iterator[Server]:
    """Run `manage.py serve` on a folder of its own until the block ends.

    Unless it is a new machine, its tables are there: a server makes them in seconds.
    """
    database = folder / "garry.sqlite3"
    if not new_machine and not database.exists():
        folder.mkdir(parents=True, exist_ok=True)
        database.write_bytes(read_tables())
    port = free_port()
    process = subprocess.Popen(
        [sys.executable, *program, "serve", *arguments],
        cwd=ROOT,
        env=clean_environment(folder, port) | dict(settings or {}),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdout is not None
    said = ""
    try:
        for line in process.stdout:
            said += line
            if line.startswith("Ready"):
                break
        yield Server(port, folder, process, said)
    finally:
        process.kill()
        process.wait(10)
        process.stdout.close()
