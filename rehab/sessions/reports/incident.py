"""What a robot's incident comes to: its figures, its course in words, and its replay on a page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from django.utils.translation import gettext

from rehab.sessions.formatting import format_number
from robot.wire.incident import TICK, read_aside

Record = dict[str, Any]

TOLD_BEFORE_S = 12.0  # of the course in words; the replay has all of it
REPLAY_EVERY_S = 0.1
MAX_ENTRIES = 80
ORDERED = slice(0, 2)  # of a tick: what was ordered
# What comes too often to be listed; the downloaded file has it.
TOO_FREQUENT = {"heartbeat", "step", "status"}


@dataclass(frozen=True, slots=True)
class Entry:
    """Something that happened: when, from the stop on [s]; in words; why, as a code."""

    at_s: float
    text: str
    reason: str = ""

    @property
    def time(self) -> str:
        """When, with its sign."""
        return f"{'+' if self.at_s >= 0 else '−'}{format_number(abs(self.at_s), 2)} s"


@dataclass(frozen=True, slots=True)
class IncidentReview:
    """An incident as a page shows it: labels with figures, its course, and what is replayed."""

    figures: list[tuple[str, str]]
    entries: list[Entry]
    replay: dict[str, Any]


def review_incident(records: Sequence[Record]) -> IncidentReview:
    """Return the review of a recording."""
    # The last of its kind: one before it was of an earlier incident.
    stops = [one["at_s"] for one in records if one.get("is_first") is True] or [0.0]
    stopped_s = stops[-1]
    ticks = [one for one in records if _is_tick(one)]
    entries = [entry for entry in _entries(records, stopped_s) if entry.at_s >= -TOLD_BEFORE_S]
    return IncidentReview(
        _figures(ticks, stopped_s), entries[:MAX_ENTRIES], _replay(records, ticks)
    )


def _is_tick(record: Record) -> bool:
    tick = record.get("tick")
    if not isinstance(tick, list) or len(tick) != len(TICK):
        return False
    return all(isinstance(one, int | float) and math.isfinite(one) for one in tick)


def _figures(ticks: Sequence[Record], stopped_s: float) -> list[tuple[str, str]]:
    """Return how it moved at the stop and how soon it stood, as labels with values."""
    before = [one for one in ticks if one["at_s"] <= stopped_s]
    after = [one for one in ticks if one["at_s"] >= stopped_s]
    if not before or not after:
        return []
    *_, x_m, y_m, _heading, speed_m_s, turn_rad_s = before[-1]["tick"]
    if left_m_s := read_aside(before[-1])[1]:
        speed_m_s = math.hypot(speed_m_s, left_m_s)
    moving = [
        one["at_s"] - stopped_s
        for one in after
        if max(abs(one["tick"][5]), abs(read_aside(one)[1])) > 0.01 or abs(one["tick"][6]) > 0.05
    ]
    way_m = sum(
        math.hypot(two["tick"][2] - one["tick"][2], two["tick"][3] - one["tick"][3])
        for one, two in pairwise(after)
    )
    return [
        (gettext("Speed at the stop"), f"{format_number(speed_m_s, 2)} m/s"),
        (gettext("Turning at the stop"), f"{format_number(math.degrees(turn_rad_s), 0)}°/s"),
        (gettext("From its mark"), f"{format_number(100 * math.hypot(x_m, y_m), 0)} cm"),
        (gettext("It moved on for"), f"{format_number(max(moving, default=0.0), 2)} s"),
        (gettext("It moved on by"), f"{format_number(100 * way_m, 1)} cm"),
    ]


def _entries(records: Sequence[Record], stopped_s: float) -> Iterator[Entry]:
    """Yield what happened, in words."""
    felt: set[str] = set()
    was_moving: bool | None = None
    for record in records:
        at_s = record["at_s"] - stopped_s
        if _is_tick(record):
            is_moving = any((*record["tick"][ORDERED], read_aside(record)[0]))
            if was_moving is not None and is_moving != was_moving:
                words = gettext("ordered to move") if is_moving else gettext("ordered to stand")
                yield Entry(at_s, words)
            was_moving = is_moving
            hazards = {str(one) for one in record.get("hazards") or []}
            for hazard in sorted(hazards - felt):
                yield Entry(at_s, gettext("felt"), hazard)
            felt = hazards
        elif isinstance(received := record.get("received"), dict):
            what = str(received.get("type", ""))[:32]
            if what not in TOO_FREQUENT:
                yield Entry(at_s, gettext("the server said: %(what)s") % {"what": what})
        elif isinstance(sent := record.get("sent"), dict):
            if str(sent.get("kind")) not in TOO_FREQUENT:
                yield _describe_report(at_s, sent)
        elif "retained" in record:
            yield Entry(at_s, gettext("stopped"), str(record["retained"])[:64])
        elif "lost" in record:
            words = gettext("%(count)s records are missing: the disk was too slow")
            yield Entry(at_s, words % {"count": record["lost"]})


def _describe_report(at_s: float, said: Record) -> Entry:
    """Return the entry of a report to the server."""
    name = str(said.get("name") or said.get("gesture") or "")[:64]
    reason: Any = said.get("reason")
    match said.get("kind"), said.get("phase"):
        case "gesture", "started":
            words = gettext("began %(gesture)s") % {"gesture": name}
        case "gesture", _:
            words, reason = gettext("ended %(gesture)s") % {"gesture": name}, said.get("outcome")
        case "decision", _:
            words = gettext("decided: %(gesture)s") % {"gesture": name or gettext("no gesture")}
        case kind, _:
            words = str(kind)[:32]
    return Entry(at_s, words, str(reason or "")[:64])


def _replay(records: Sequence[Record], ticks: Sequence[Record]) -> dict[str, Any]:
    """Return a preview (robot/motion/preview.py) of all of it."""
    if not ticks:
        return {}
    from_s = ticks[0]["at_s"]
    poses: list[list[float]] = []
    for one in ticks:
        at_s = round(one["at_s"] - from_s, 2)
        if not poses or at_s - poses[-1][0] >= REPLAY_EVERY_S - 0.01:
            poses.append([at_s, *one["tick"][2:5]])
    lights = [
        [round(record["at_s"] - from_s, 2), *map(str, sent["lights"][:2])]
        for record in records
        if isinstance(sent := record.get("sent"), dict) and isinstance(sent.get("lights"), list)
    ]
    took_s = round(ticks[-1]["at_s"] - from_s, 2)
    return {"took_s": took_s, "poses": poses, "lights": lights, "notes": [], "mood": "calm"}
