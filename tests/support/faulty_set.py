"""Two servers' database, network, disk and clocks, each of which can be broken.

Mounting a small disk needs root, a clock of the database that jumps libfaketime (Debian: faketime).
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.support.cable import Cable, run_cables
from tests.support.hosted import Restarts, run_postgres
from tests.support.pair import Pair

DISK_MB = 256
FAKE_TIME = next(iter(sorted(Path("/usr/lib").glob("*/faketime/libfaketime.so.1"))), None)


class Clock:
    """The clock of a program, which jumps and comes back while it runs."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self.jump("+0")

    @property
    def program(self) -> tuple[str, ...]:
        """The server that goes by it, in Python's terms."""
        return ("-m", "tests.support.jumping_server", str(self._file))

    @property
    def variables(self) -> dict[str, str]:
        """What the environment of PostgreSQL needs to go by it; its sleeps are not touched."""
        if FAKE_TIME is None:
            return {}
        return {
            "LD_PRELOAD": str(FAKE_TIME),
            "FAKETIME_TIMESTAMP_FILE": str(self._file),
            "FAKETIME_CACHE_DURATION": "1",
            "FAKETIME_DONT_FAKE_MONOTONIC": "1",
        }

    def jump(self, seconds: str) -> None:
        self._file.write_text(seconds)
        self._file.chmod(0o644)  # also PostgreSQL reads it, as somebody else


@contextmanager
def small_disk(folder: Path) -> Iterator[Path | None]:
    """Mount a disk of its own, where one may."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={DISK_MB}m,mode=755", "tmpfs", str(folder)]
    if subprocess.run(command, capture_output=True).returncode != 0:
        yield None
        return
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@dataclass(frozen=True)
class FaultySet:
    """What two servers stand on, and what breaks it.

    Attributes
    ----------
    restarts
        By program: kills it and starts it again.
    cables
        Of each server: to the database.
    disk
        The database's, where one may mount it.
    clocks
        Of each server, and the database's.
    """

    pair: Pair
    restarts: Restarts
    cables: list[list[Cable]]
    disk: Path | None
    clocks: list[Clock]


@contextmanager
def run_faulty_set(folder: Path) -> Iterator[FaultySet]:
    """Run the database, and name two servers, each with cables and a clock of its own."""
    restarts: Restarts = {}
    cables: list[list[Cable]] = []
    with ExitStack() as stack:
        open_folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="garry-faults-")))
        open_folder.chmod(0o755)  # PostgreSQL runs as somebody else
        clocks = [Clock(open_folder / f"clock {name}") for name in (0, 1, "database")]
        disk = stack.enter_context(small_disk(open_folder / "disk"))
        database = stack.enter_context(
            run_postgres(restarts, disk=disk, variables=clocks[2].variables)
        )
        pair = Pair(folder, database)
        for place in range(2):
            urls = {"GARRY_DATABASE_URL": database}
            pair.own_environments[place], its_cables = stack.enter_context(run_cables(urls))
            cables.append(its_cables)
            pair.programs[place] = clocks[place].program
        yield FaultySet(pair, restarts, cables, disk, clocks)
