"""SQLite databases with the tables and the first rows, kept until the product's code changes.

Migrating takes seconds of every test run and of every server that a test starts.
"""

from __future__ import annotations

import os
import sys
from functools import cache
from hashlib import sha256
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / ".pytest_cache" / "templates"


@cache
def _digest() -> str:
    """Return a digest of all that a migrated database may depend on."""
    if told := os.environ.get("GARRY_TEST_TABLES"):  # of code that differs, its tables do not
        return told
    digest = sha256(sys.version.encode())
    code = [*(ROOT / "garry_site").rglob("*.py"), *(ROOT / "rehab").rglob("*.py")]
    for file in (ROOT / "constraints.txt", *sorted(code)):
        digest.update(f"{file.relative_to(ROOT)} {file.stat().st_size}\n".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()[:20]


def read(name: str) -> bytes | None:
    """Return the file of a kind of database, if it was made since the code has changed."""
    try:
        return _file(name).read_bytes()
    except FileNotFoundError:
        return None


def keep(name: str, made: bytes) -> None:
    """Keep such a file for the runs to come. Other workers may read it, or keep it as well."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    beside = FOLDER / f"{name}-{os.getpid()}.new"
    beside.write_bytes(made)
    beside.replace(_file(name))
    for old in set(FOLDER.glob(f"{name}-*.sqlite3")) - {_file(name)}:
        old.unlink(missing_ok=True)


def _file(name: str) -> Path:
    return FOLDER / f"{name}-{_digest()}.sqlite3"
