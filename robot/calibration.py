"""What was measured and learned of bases, in files of this computer.

`python -m robot calibrate` writes how each answers, `python -m robot tag learn` how it sees home.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from robot.atomic_file import write_atomically
from robot.bases import MobileBase
from robot.homing.home_view import BadHomeView, HomeView
from robot.motion.base_response import Response


class BadCalibration(ValueError):
    """A file of measurements that cannot be used; the message names the cure."""


def calibration_file() -> Path:
    """Return the file in GARRY_ROBOT_CALIBRATION, else the one of this account."""
    if named := os.environ.get("GARRY_ROBOT_CALIBRATION"):
        return Path(named)
    return Path.home() / ".config" / "garry" / "robot.json"


def apply_calibration(base: MobileBase) -> bool:
    """Tell an open base what was measured of it, and return whether anything was.

    Raises BadCalibration.
    """
    measured = _read(calibration_file()).get(base.identity)
    if measured is None:
        return False
    try:
        base.calibrate(Response(**measured))
    except (TypeError, ValueError) as problem:
        raise BadCalibration(
            f"{calibration_file()} has no usable measurement of {base.identity}: {problem} Run "
            f"`python -m robot calibrate` again."
        ) from None
    return True


def store_calibration(base: MobileBase, response: Response) -> Path:
    """Store what was measured of a base, and return the file. Raises BadCalibration.

    Parameters
    ----------
    base
        An open base: its identity is the key.
    response
        How it was measured to answer.
    """
    return _store(calibration_file(), base, asdict(response))


def home_file() -> Path:
    """Return the file of how bases see home, beside that of the measurements."""
    return calibration_file().with_suffix(".home.json")


def find_home_view(base: MobileBase) -> HomeView | None:
    """Return how an open base sees home; None where it has not learned that.

    Raises BadCalibration.
    """
    stored = _read(home_file()).get(base.identity)
    if stored is None:
        return None
    try:
        return HomeView.from_json(stored)
    except BadHomeView as problem:
        raise BadCalibration(
            f"{home_file()} does not say how {base.identity} sees home: {problem} Run "
            f"`python -m robot tag learn` again."
        ) from None


def home_views() -> list[HomeView]:
    """Return how each base of this computer sees home. Raises BadCalibration."""
    try:
        return [HomeView.from_json(stored) for stored in _read(home_file()).values()]
    except BadHomeView as problem:
        raise BadCalibration(f"{home_file()} cannot be used: {problem} Remove it.") from None


def store_home_view(base: MobileBase, view: HomeView) -> Path:
    """Store how an open base sees home, and return the file. Raises BadCalibration."""
    return _store(home_file(), base, view.to_json())


def _store(path: Path, base: MobileBase, value: Mapping[str, Any]) -> Path:
    stored = _read(path) | {base.identity: value}
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, f"{json.dumps(stored, indent=1)}\n".encode(), mode=0o644)
    return path


def _read(path: Path) -> dict[str, Any]:
    try:
        measured = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as problem:
        raise BadCalibration(f"{path} cannot be read: {problem}. Mend or remove it.") from None
    if not isinstance(measured, dict):
        raise BadCalibration(f"{path} holds no measurements. Remove it.")
    return measured
