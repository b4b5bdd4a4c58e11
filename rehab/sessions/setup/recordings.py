"""Recorded signals that a person uploads, has checked, and stores as a recording to walk with.

A file comes in parts, none longer than the server takes of any request. Whatever reads it runs as a
process of its own with bounds, so that a damaged file cannot take the server down.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import threading
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any

from django.conf import settings
from django.db import close_old_connections
from django.utils.text import slugify
from django.utils.translation import gettext

from rehab.sources.recording.sample_recordings import is_sample, mark_of
from robot.plugins import find_names
from robot.wire.limits import TIME_MAX_S

UPLOAD_BYTES_MAX = 64 * 1024 * 1024  # five minutes of 1 kHz as CSV; half a minute is enough
PART_BYTES = 1024 * 1024
WAIT_S = 90.0
# Variables of the server that a file's parser gets: no key, no database.
PASSED_ON = {
    "HOME",
    "LANG",
    "LC_ALL",
    "LD_LIBRARY_PATH",
    "PATH",
    "PYTHONPATH",
    "SYSTEMROOT",
    "TMPDIR",
}
RETAINED_S = 86_400.0  # an upload that was not stored as a recording
_one_at_a_time = threading.Lock()  # a check takes a processor and gigabytes
# What `rehab.gait.recordings.readers` reads; it is not imported, as servers do without numpy.
OWN_ENDINGS = (".c3d", ".csv", ".mot", ".sto", ".trc", ".tsv", ".txt")
FILES_MAX = 4  # of one walk: forces, moments, angles, markers
SIDES, CHANNELS = ("left", "right"), ("force", "moment", "angle")
MASS_MIN_KG, MASS_MAX_KG = 10, 300


class UploadRefused(Exception):
    """A part of a file that cannot be taken."""


@dataclass(frozen=True, slots=True)
class Checked:
    """What the check of a file came to.

    Attributes
    ----------
    found
        As ``rehab.gait.setup.report.setup_to_json``; None where nothing was recognized.
    wrong
        What speaks against it, or against the columns that were given.
    """

    found: dict[str, Any] | None
    wrong: list[str]


@cache
def find_endings() -> tuple[str, ...]:
    """Return the endings of files that can be read here, those of plug-ins last."""
    return (*OWN_ENDINGS, *(f".{name}" for name in find_names("garry.readers") if name.isalnum()))


def recordings_folder() -> Path:
    """Return the folder of the recordings that the set-up offers."""
    folder: Path = settings.DATA_DIR / "recordings"
    return folder


def uploaded_file(person: int, ending: str, place: int = 0) -> Path:
    """Return where a file of a person's upload is stored; another upload replaces them all.

    ``place`` counts the files of one walk. Raises UploadRefused for a kind of file that cannot be
    read.
    """
    if ending not in find_endings() or not 0 <= place < FILES_MAX:
        raise UploadRefused
    folder: Path = settings.DATA_DIR / "uploads"
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder / f"{person}-{place}{ending}"


def discard_old_uploads(now: datetime) -> None:
    """Remove uploads that were not stored as a recording within a day."""
    folder = settings.DATA_DIR / "uploads"
    for file in folder.iterdir() if folder.is_dir() else ():
        if now.timestamp() - file.stat().st_mtime >= RETAINED_S:
            file.unlink(missing_ok=True)


def add_part(file: Path, part: bytes, at: int) -> None:
    """Add a part of an upload at its place; the first one starts a new file.

    Raises UploadRefused for a part that does not follow the one before, and beyond the largest
    file.
    """
    is_known = file.exists() if at else True
    if not is_known or at < 0 or len(part) > PART_BYTES or at + len(part) > UPLOAD_BYTES_MAX:
        raise UploadRefused
    if at and file.stat().st_size != at:
        raise UploadRefused
    person, _, place = file.stem.partition("-")
    if not at:
        for other in file.parent.glob(f"{person}-*"):
            if int(other.stem.partition("-")[2]) >= int(place):
                other.unlink(missing_ok=True)
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW  # never through a link
    try:
        descriptor = os.open(file, flags, 0o600)
    except OSError:
        raise UploadRefused from None
    with os.fdopen(descriptor, "ab") as opened:
        opened.write(part)


def check_upload(
    files: list[Path],
    mass_kg: float | None,
    columns: list[str] | None = None,
    save: Path | None = None,
    *,
    is_overground: bool | None = None,
) -> Checked:
    """Return what the columns of an upload's files are, compared with those given.

    If asked for, it is stored in SI units, and only where nothing is wrong. A server checks one
    upload at a time; who waits for that takes no connection to the database from other pages.
    """
    close_old_connections()
    if not _one_at_a_time.acquire(timeout=WAIT_S):
        return Checked(None, [gettext("Other files are being checked. Try again in a minute.")])
    try:
        return _check(files, mass_kg, columns, save, is_overground)
    finally:
        _one_at_a_time.release()


def _check(
    files: list[Path],
    mass_kg: float | None,
    columns: list[str] | None,
    save: Path | None,
    is_overground: bool | None,
) -> Checked:
    arguments = ["nice"] if shutil.which("nice") else []  # a training goes first
    arguments += [sys.executable, "-m", "rehab.gait", "check", *map(str, files)]
    arguments += ["--json", "--bounded"]
    arguments += ["--mass", f"{mass_kg:g}"] if mass_kg else []
    if is_overground is not None:
        arguments += ["--overground" if is_overground else "--no-overground"]
    arguments += ["--save", str(save)] if save else []
    arguments += ["--columns", *columns] if columns else []
    if save:
        save.parent.mkdir(exist_ok=True)
    try:
        done = subprocess.run(
            arguments,
            cwd=settings.BASE_DIR,
            env={name: os.environ[name] for name in PASSED_ON & os.environ.keys()}
            | {"OPENBLAS_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
            timeout=WAIT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Checked(None, [])
    if save and done.returncode in (0, 1):  # it is stored
        mark_of(save).unlink(missing_ok=True)
        if any(map(is_sample, files)):
            mark_of(save).touch()
    said = [line for line in done.stderr.splitlines() if line.strip()]
    if done.returncode not in (0, 1, 2) or (said and said[0].startswith("Traceback")):
        return Checked(None, [])
    return Checked(json.loads(done.stdout) if done.stdout else None, said)


def name_recording(text: str) -> str:
    """Return a file's name from what a person calls the recording; empty where nothing is left."""
    stem = slugify(text)[:60]
    return f"{stem}.csv" if stem else ""


def write_columns(chosen: dict[str, dict[str, str]], time: dict[str, str]) -> list[str]:
    """Return chosen columns as ``rehab.gait`` reads them: ``left.force=Fz1*-1@0.01``.

    Raises
    ------
    ValueError
        For a factor or delay that is no number.
    """
    pairs = [f"time={time['column']}*{_number(time['factor'], 1):.9g}"]
    for channel, one in chosen.items():
        if one["column"]:
            factor, delay_s = _number(one["factor"], 1), _number(one["delay_ms"], 0) / 1000
            pairs.append(f"{channel}={one['column']}*{factor:.9g}@{delay_s:.9g}")
    return pairs


def _number(text: str, usual: float) -> float:
    number = float(text.replace(",", ".")) if text.strip() else usual
    if not abs(number) < TIME_MAX_S:
        raise ValueError(text)
    return number
