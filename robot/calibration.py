"""What was measured of bases, in a file of this computer: `python -m robot calibrate` writes it."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

from robot.atomic_file import write_atomically
from robot.bases import MobileBase
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
    path = calibration_file()
    measured = _read(path) | {base.identity: asdict(response)}
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, f"{json.dumps(measured, indent=1)}\n".encode(), mode=0o644)
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
