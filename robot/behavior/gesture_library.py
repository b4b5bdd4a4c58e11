"""The gestures that a robot can perform: built-in ones, and those received with the cue."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from robot.motion.dry_run import validate_gesture
from robot.motion.gesture import Gesture
from robot.motion.gesture_errors import BadGesture
from robot.motion.gestures import BUILT_IN, known_names
from robot.motion.limits import Limits

# Why a name cannot be performed.
UNKNOWN_GESTURE = "unknown_gesture"
BAD_GESTURE = "bad_gesture"  # received with the cue, and refused


class GestureLibrary:
    """The built-in gestures and the received ones, by name.

    Parameters
    ----------
    limits
        Speeds and accelerations that a gesture must keep to.
    """

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._received: dict[str, Gesture | None] = {}  # None: refused

    def replace_received(self, gestures: Iterable[Any]) -> list[str]:
        """Replace the received gestures, and return what is wrong with the refused ones.

        Each is parsed, checked and dry-run here, whatever the server has checked.
        """
        self._received, problems = {}, []
        for data in gestures:
            try:
                gesture = validate_gesture(data, self._limits)
            except BadGesture as problem:
                name = data.get("name") if isinstance(data, dict) else None
                # A name that every robot knows means that gesture, whatever else comes under it.
                if isinstance(name, str) and name not in known_names():
                    self._received[name] = None
                problems.append(f"gesture {name}: {problem}")
            else:
                self._received[gesture.name] = gesture
        return problems

    def find(self, name: str) -> tuple[Gesture | None, str]:
        """Return the gesture of that name and no reason, or None and why there is none."""
        if name in self._received:
            gesture = self._received[name]
            return gesture, "" if gesture else BAD_GESTURE
        gesture = BUILT_IN.get(name)
        return gesture, "" if gesture else UNKNOWN_GESTURE
