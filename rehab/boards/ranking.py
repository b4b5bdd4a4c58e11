"""Which place a session has among the same patient's own.

Points rank sessions of one feedback type, hit rates those of all. Sessions that a simulated patient
walked and those that a person walked never share a board. Only finished sessions with judged steps
are on one: others have no figures.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from rehab.people.models import User
from rehab.sessions.log import SessionMetric
from rehab.sessions.models import TrainingSession
from rehab.training.changes import State
from rehab.training.valences import Valence

# More sessions than these are shown as the best ones and those around the session at hand.
SHOWN = 50
SHOWN_BEST = 10
SHOWN_AROUND = 15


class By(StrEnum):
    """What a board ranks by."""

    POINTS = "points"
    KEPT = "kept"  # points that were not lost, where points can only be lost
    RATE = "rate"


@dataclass(frozen=True, slots=True)
class Figures:
    """What boards know of a session. ``streak`` is its longest row of hits; ``mixed`` one whose
    feedback type was changed on its way: it ranks by its hit rate alone.
    """

    session_id: int
    valence: str
    hit_rate: float
    score: float | None
    streak: float
    mixed: bool = False

    def stake(self, cost: int) -> int:
        """Give the points that could have been lost, at ``cost`` points a miss.

        Lost points over the share of misses; without a miss the longest row is every step.
        """
        misses = 1 - self.hit_rate
        return round(-(self.score or 0) / misses if misses else self.streak * cost)


@dataclass(frozen=True, slots=True)
class Entry:
    """A session's place, and the rank that it may share.

    ``stake`` is what could be kept, on boards of kept points.
    """

    session_id: int
    place: int
    rank: int
    value: int
    stake: int | None = None


def ranking_of(valence: Valence) -> By:
    """Say what sessions of one feedback type are ranked by."""
    if not valence.has_points:
        return By.RATE
    return By.POINTS if valence.rewards else By.KEPT


def read_figures(user: User, session: TrainingSession) -> list[Figures]:
    """Give the figures of all sessions that may stand beside this one, itself included.

    One query by the patient's index and the metrics' own: no other patient's rows are read.
    """
    rows = SessionMetric.objects.visible_to(user).filter(
        session__patient=session.patient_id,
        session__state=State.FINISHED.value,
        session__simulated=session.simulated,
        session__excluded=False,
        slug__in=("hit_rate", "score", "best_streak"),
    )
    found: dict[tuple[int, str, bool], dict[str, float]] = defaultdict(dict)
    for session_id, valence, changed_to, slug, value in rows.values_list(
        "session_id", "session__valence", "session__changed_to", "slug", "value"
    ).order_by():
        found[session_id, valence, bool(changed_to)][slug] = value
    return [
        Figures(pk, valence, own["hit_rate"], own.get("score"), own.get("best_streak", 0.0), mixed)
        for (pk, valence, mixed), own in found.items()
        if "hit_rate" in own
    ]


def rank(figures: Iterable[Figures], by: By, cost: int = 1) -> list[Entry]:
    """Give the places, best first; equal figures share one (1, 2, 2, 4), the earlier on top.

    A hit rate counts in whole percent, as it is shown, so that what looks equal is equal.
    """
    measured: list[tuple[int, int, int | None]] = []
    for own in figures:
        if by is By.RATE:
            measured.append((round(100 * own.hit_rate), own.session_id, None))
        elif by is By.POINTS:
            measured.append((round(own.score or 0), own.session_id, None))
        else:
            at_stake = own.stake(cost)
            measured.append((at_stake + round(own.score or 0), own.session_id, at_stake))
    measured.sort(key=lambda item: (-item[0], item[1]))
    entries: list[Entry] = []
    for place, (value, session_id, stake) in enumerate(measured, start=1):
        tied = place > 1 and entries[-1].value == value
        shared = entries[-1].rank if tied else place
        entries.append(Entry(session_id, place, shared, value, stake))
    return entries


def cut(entries: list[Entry], session_id: int) -> list[Entry]:
    """Give what is shown of a long board: the best, and those around the session at hand."""
    if len(entries) <= SHOWN:
        return entries
    mine = next((i for i, entry in enumerate(entries) if entry.session_id == session_id), 0)
    around = range(max(SHOWN_BEST, mine - SHOWN_AROUND), min(len(entries), mine + SHOWN_AROUND + 1))
    return entries[:SHOWN_BEST] + [entries[i] for i in around]
