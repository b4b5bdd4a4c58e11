"""The lights and notes of a composed gesture, as a person writes them: an entry a line."""

from __future__ import annotations

from typing import Any

from django.core.exceptions import ValidationError
from django.utils.translation import gettext

from rehab.people.web.refusals import format_refusal
from robot.motion.gesture_errors import BadGesture
from robot.motion.lights_and_sounds import read_score

TrackEntry = dict[str, Any]

EXAMPLES = {"lights": "0.5 green off", "notes": "0.5 440 0.2"}


def read_tracks(lights: str, notes: str) -> dict[str, list[TrackEntry]]:
    """Return the tracks as a robot gets them; none where nothing is written.

    Raises ValidationError, by field, with the line and the cure.
    """
    tracks: dict[str, list[TrackEntry]] = {}
    problems: dict[str, str] = {}
    for name, text, read in (("lights", lights, _read_light), ("notes", notes, _read_note)):
        entries: list[TrackEntry] = []
        for number, line in enumerate(text.splitlines(), start=1):
            if words := line.split():
                try:
                    entries.append(read(words))
                except (IndexError, ValueError):
                    refusal = gettext("Line %(number)d is not written like “%(example)s”.")
                    problems[name] = refusal % {"number": number, "example": EXAMPLES[name]}
        if entries:
            tracks[name] = entries
            try:
                read_score({name: entries})
            except BadGesture as problem:
                problems.setdefault(name, format_refusal(problem))
    if problems:
        raise ValidationError(problems)
    return tracks


def _read_light(words: list[str]) -> TrackEntry:
    at_s, first, *rest = words
    second = rest.pop(0) if rest else "off"
    if rest:
        raise ValueError
    return {"at_s": float(at_s), "first": first, "second": second}


def _read_note(words: list[str]) -> TrackEntry:
    at_s, sound, *rest = words
    if not rest:
        return {"at_s": float(at_s), "melody": sound}
    (duration_s,) = rest
    return {"at_s": float(at_s), "frequency_hz": float(sound), "duration_s": float(duration_s)}
