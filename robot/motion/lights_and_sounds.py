"""Scores: what a base shows and plays while it performs, on one clock with its motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from robot.motion.gesture_errors import BadGesture
from robot.wire.frames import to_number

MAX_ENTRIES = 64  # of lights, and of notes
SCORE_MAX_S = 17.0  # a gesture's longest, and its announcement
# What a Kobuki plays: notes of a quarter of a second at most (docs/reference/kobuki.md#commands),
# in the range of a small loudspeaker (ours).
NOTE_MAX_S = 0.25
LOWEST_HZ, HIGHEST_HZ = 150.0, 4000.0


class Color(StrEnum):
    """Colors of a light. Red is no gesture's: it says that the base is stopped."""

    OFF = "off"
    GREEN = "green"
    ORANGE = "orange"


class Melody(StrEnum):
    """Melodies that a Kobuki knows. Its seventh, the error, says that the base is stopped."""

    ON = "on"
    OFF = "off"
    RECHARGE = "recharge"
    BUTTON = "button"
    CLEANING_START = "cleaning_start"
    CLEANING_END = "cleaning_end"


@dataclass(frozen=True, slots=True)
class Light:
    """Both lights from a time on [s]."""

    at_s: float
    first: Color
    second: Color


@dataclass(frozen=True, slots=True)
class Note:
    """A note [Hz, s] at a time [s], or a melody in its place."""

    at_s: float
    frequency_hz: float = 0.0
    duration_s: float = 0.0
    melody: Melody | None = None


@dataclass(frozen=True, slots=True)
class Score:
    """Lights and notes of a gesture, in their order. Its clock begins with the announcement."""

    lights: tuple[Light, ...] = ()
    notes: tuple[Note, ...] = ()

    @property
    def mood(self) -> str:
        """How it sounds: glad where its notes rise, sad where they fall, else calm."""
        pitches = [note.frequency_hz for note in self.notes if note.melody is None]
        if not pitches or pitches[-1] == pitches[0]:
            return "calm"
        return "glad" if pitches[-1] > pitches[0] else "sad"

    @property
    def quiet(self) -> Score:
        """The score for quiet rooms: lights alone, for a base has one loudness."""
        return replace(self, notes=())


def notes(*frequencies_hz: float, at_s: float = 0.0, each_s: float = 0.12) -> tuple[Note, ...]:
    """Return notes that follow each other.

    Parameters
    ----------
    frequencies_hz
        Their pitches [Hz].
    at_s
        When the first begins [s].
    each_s
        How long each is [s], without a pause between.
    """
    return tuple(
        Note(round(at_s + number * each_s, 3), frequency_hz, each_s)
        for number, frequency_hz in enumerate(frequencies_hz)
    )


C5, E5, G5, C6, E6, G6 = 523.25, 659.26, 783.99, 1046.50, 1318.51, 1567.98
A4, F4, D4, A3 = 440.0, 349.23, 293.66, 220.0
_ANNOUNCED = Light(0.0, Color.ORANGE, Color.OFF)

# Success rises, and its lights with it. What did not succeed falls, low and short: a sigh and
# never the sound of success. What nearly did stays on its note.
_GLAD = (
    _ANNOUNCED,
    Light(0.5, Color.GREEN, Color.OFF),
    Light(1.3, Color.GREEN, Color.GREEN),
    Light(1.8, Color.ORANGE, Color.GREEN),
    Light(2.3, Color.GREEN, Color.GREEN),
)
_SAD = (_ANNOUNCED, Light(0.5, Color.ORANGE, Color.ORANGE), Light(1.8, Color.OFF, Color.ORANGE))
RISING = Score(_GLAD, (*notes(C5, E5, G5), *notes(G5, C6, at_s=1.3)))
RISING_HIGH = Score(_GLAD, (*notes(E5, G5, C6), *notes(C6, E6, at_s=1.3)))
RISING_LONG = Score(_GLAD, (*notes(C5, E5, G5, C6, each_s=0.1), *notes(C6, E6, G6, at_s=1.3)))
FALLING = Score(_SAD, notes(A4, F4, D4, each_s=0.15))
LOW_FALLING = Score(_SAD, notes(F4, D4, A3, each_s=0.15))
SIGHING = Score(_SAD, notes(A4, F4, each_s=0.2))
ASKING = Score(_SAD[:2], notes(A4, A4, each_s=0.15))
# Neither: one note tells that it is about to move.
NEUTRAL = Score((_ANNOUNCED,), notes(A4))


def read_score(data: Mapping[str, Any]) -> Score:
    """Return the tracks of a composed gesture's data; one without is announced by ``NEUTRAL``.

    Parameters
    ----------
    data
        May have ``"lights": [{"at_s": 0, "first": "green", "second": "off"}]`` and
        ``"notes": [{"at_s": 0.2, "frequency_hz": 440, "duration_s": 0.1}]``, where a note may be
        ``{"at_s": 1, "melody": "button"}``.

    Raises
    ------
    BadGesture
        For anything else; names the entry and the cure.
    """
    if data.get("lights") is None and data.get("notes") is None:
        return NEUTRAL
    lights = [_read_light(n, one) for n, one in enumerate(_entries(data, "lights"), start=1)]
    played = [_read_note(n, one) for n, one in enumerate(_entries(data, "notes"), start=1)]
    by_time = sorted(lights, key=lambda light: light.at_s)
    return Score(tuple(by_time), tuple(sorted(played, key=lambda note: note.at_s)))


def _entries(data: Mapping[str, Any], track: str) -> list[Mapping[str, Any]]:
    entries = data.get(track)
    if entries is None:
        return []
    if not isinstance(entries, list) or len(entries) > MAX_ENTRIES:
        raise BadGesture(
            "{track} is a list of up to {most} entries.", track=track, most=MAX_ENTRIES
        )
    for number, entry in enumerate(entries, start=1):
        if not isinstance(entry, Mapping):
            raise BadGesture("{track}, {number}: no object.", track=track, number=number)
    return entries


def _read_light(number: int, entry: Mapping[str, Any]) -> Light:
    try:
        first, second = Color(entry.get("first", "off")), Color(entry.get("second", "off"))
    except ValueError:
        raise BadGesture(
            "Light {number} is off, green or orange; red says that the robot is stopped.",
            number=number,
        ) from None
    return Light(_number(entry, "at_s", "Light", number, 0.0, SCORE_MAX_S), first, second)


def _read_note(number: int, entry: Mapping[str, Any]) -> Note:
    at_s = _number(entry, "at_s", "Note", number, 0.0, SCORE_MAX_S)
    if entry.get("melody") is not None:
        try:
            return Note(at_s, melody=Melody(entry["melody"]))
        except ValueError:
            raise BadGesture(
                "Note {number} has no such melody. There are: {names}.",
                number=number,
                names=", ".join(Melody),
            ) from None
    return Note(
        at_s,
        _number(entry, "frequency_hz", "Note", number, LOWEST_HZ, HIGHEST_HZ),
        _number(entry, "duration_s", "Note", number, 0.02, NOTE_MAX_S),
    )


def _number(
    entry: Mapping[str, Any], name: str, kind: str, number: int, low: float, high: float
) -> float:
    value = to_number(entry.get(name), low, high)
    if value is None:
        raise BadGesture(
            "{kind} {number}: {name} is a number from {low:g} to {high:g}.",
            kind=kind,
            number=number,
            name=name,
            low=low,
            high=high,
        )
    return value
