"""The whole way of a clinic by the commands of docs/hosting.md, walked before and after."""

from __future__ import annotations

from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path

import pytest

from rehab.exports.encryption import generate_key
from tests.bench.own_database import make_postgresql
from tests.support.servers import run_python

pytestmark = pytest.mark.long

SEEDED = """
from tests.support.world import build_world
build_world("amber")
"""
NAME = "zqamberclinicqz"


class Place:
    """An installation: a folder with its own key, and a database."""

    def __init__(self, folder: Path, database: str = "") -> None:
        folder.mkdir(mode=0o700)
        self.folder = folder
        self.variables = {"GARRY_DATABASE_URL": database} if database else {}
        self.manage("migrate", "-v0")

    def manage(self, *arguments: object) -> str:
        return run_python(self.folder, "manage.py", *map(str, arguments), **self.variables)

    def walk(self, seed: int) -> None:
        """Let a simulated patient walk."""
        how = ("--strides", 120, "--valence", "positive", "--goal", 1.2, "--clinic", NAME)
        self.manage("runsession", "--synthetic", seed, *how)


def test_from_a_laptop_to_two_hosts_and_back(tmp_path):
    secret, public = generate_key()
    key = tmp_path / "key.txt"
    key.write_text(secret)
    with ExitStack() as stack:
        places = [Place(tmp_path / "laptop")]
        for name in ("first", "second"):
            database = stack.enter_context(make_postgresql(name))
            places.append(Place(tmp_path / name, database))
        places.append(Place(tmp_path / "new laptop"))
        places[0].manage("shell", "-v0", "-c", SEEDED)
        for number, (here, there) in enumerate(pairwise(places), 1):
            here.walk(number)
            file = tmp_path / f"{number}.clinic"
            here.manage("clinic", "export", NAME, file, "--to", public)
            told = there.manage("clinic", "import", file, "--key", key)
            assert f"as the file says: 2 patients, {number + 1} sessions" in told
            there.manage("clinic", "verify", NAME, "--file", file, "--key", key)
            paper = file.with_suffix(".json")
            here.manage("clinic", "remove", NAME, paper, "--file", file, "--key", key)
        places[-1].walk(4)
        assert "is as it was sealed: 2 patients, 5 sessions" in places[-1].manage(
            "clinic", "verify", NAME
        )
        assert "logs         well" in places[-1].manage("doctor")
