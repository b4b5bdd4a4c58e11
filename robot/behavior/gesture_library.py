"""What a robot can perform: gestures of its own, and those that came along with the cue."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from robot.motion.dry_run import validate_gesture
from robot.motion.gesture import Gesture
from robot.motion.gesture_errors import BadGesture
from robot.motion.gestures import GESTURES, ORIGINALS
from robot.motion.limits import Limits

# Why a name cannot be performed.
UNKNOWN_GESTURE = "unknown_gesture"
BAD_GESTURE = "bad_gesture"  # it came along, and no base may perform it


class GestureLibrary:
    """Gestures by name.

    Parameters
    ----------
    own
        Those that no cue may replace.
    limits
        Speeds and accelerations that a gesture has to do with.
    """

    def __init__(self, builtin: Mapping[str, Gesture], limits: Limits) -> None:
        self.builtin = builtin
        self._limits = limits
        self._received: dict[str, Gesture | None] = {}  # None: refused

    def replace_received(self, gestures: Iterable[Any]) -> list[str]:
        """Take what came along instead of what came before; give what is wrong with the refused.

        Nobody's word counts: each is read, checked and tried here.
        """
        self._received, problems = {}, []
        for data in gestures:
            try:
                gesture = validate_gesture(data, self._limits)
                if gesture.name in self.builtin:
                    raise BadGesture(
                        "This robot has a gesture {name} of its own.", name=gesture.name
                    )
            except BadGesture as problem:
                name = data.get("name") if isinstance(data, dict) else None
                # A name that every robot knows means that gesture, whatever else comes under it.
                if isinstance(name, str) and name not in GESTURES and name not in ORIGINALS:
                    self._received[name] = None
                problems.append(f"gesture {name}: {problem}")
            else:
                self._received[gesture.name] = gesture
        return problems

    def find(self, name: str) -> tuple[Gesture | None, str]:
        """Give the gesture of that name, or why there is none."""
        if name in self._received:
            gesture = self._received[name]
            return gesture, "" if gesture else BAD_GESTURE
        gesture = self.builtin.get(name)
        return gesture, "" if gesture else UNKNOWN_GESTURE
