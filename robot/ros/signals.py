"""Lights and sounds of bases as messages, by the type of their topic."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from robot.ros.messages import STRING, without_msg

Message = dict[str, Any]

# Of each state that a base shows: a Kobuki's light (kobuki_msgs/Led), red, green and blue, a
# Kobuki's sound (kobuki_msgs/Sound), and notes [Hz].
LEDS = {"waiting": 0, "ready": 1, "moving": 2, "stopped": 3}
COLORS = {
    "waiting": (0, 0, 0),
    "ready": (0, 255, 0),
    "moving": (255, 140, 0),
    "stopped": (255, 0, 0),
}
SOUNDS = {"moving": 3, "stopped": 4}
NOTES_HZ = {"moving": (523, 659), "stopped": (330, 220)}
NOTE_NS = 120_000_000
RING = 6  # lights of a Create 3


def _led(state: str) -> Message:
    return {"value": LEDS[state]}


def _sound(state: str) -> Message:
    return {"value": SOUNDS[state]}


def _ring(state: str) -> Message:
    red, green, blue = COLORS[state]
    # While it waits, the base's own program has its lights.
    lights = [{"red": red, "green": green, "blue": blue}] * RING
    return {"leds": lights, "override_system": state != "waiting"}


def _notes(state: str) -> Message:
    runtime = {"sec": 0, "nanosec": NOTE_NS}
    notes = [{"frequency": hz, "max_runtime": runtime} for hz in NOTES_HZ[state]]
    return {"notes": notes, "append": False}


def _text(state: str) -> Message:
    return {"data": state}


# A topic of text gets the state's name: a node beside the base turns it into light and sound.
LIGHT_TYPES: Mapping[str, Callable[[str], Message]] = {
    "kobuki_msgs/Led": _led,
    "kobuki_ros_interfaces/Led": _led,
    "irobot_create_msgs/LightringLeds": _ring,
    STRING: _text,
}
SOUND_TYPES: Mapping[str, Callable[[str], Message]] = {
    "kobuki_msgs/Sound": _sound,
    "kobuki_ros_interfaces/Sound": _sound,
    "irobot_create_msgs/AudioNoteVector": _notes,
    STRING: _text,
}


def write_light(kind: str, state: str) -> Message:
    """Return the message by which a light shows a state.

    Parameters
    ----------
    kind
        Type of the topic: one of ``LIGHT_TYPES``, as ROS 1 or 2 writes it.
    state
        Name of an ``Indication``.
    """
    return LIGHT_TYPES[without_msg(kind)](state)


def write_sound(kind: str, state: str) -> Message | None:
    """Return the message that announces a state by sound; None for a silent state.

    Parameters
    ----------
    kind
        Type of the topic: one of ``SOUND_TYPES``, as ROS 1 or 2 writes it.
    state
        Name of an ``Indication``.
    """
    return SOUND_TYPES[without_msg(kind)](state) if state in SOUNDS else None
