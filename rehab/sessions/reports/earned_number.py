"""The one number of a session that its patient takes along, and its mark."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

from django.db.models import QuerySet
from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from rehab.sessions.formatting import format_number
from rehab.sessions.log import SessionMetric
from rehab.sessions.models import TrainingSession
from rehab.training.steps import Side
from rehab.training.valences import Valence


@dataclass(frozen=True, slots=True)
class Earned:
    """The one number of a session that its patient takes along, what it counts, and its mark."""

    number: str
    label: str
    mark: str


def find_earned(
    session: TrainingSession, before: QuerySet[TrainingSession], valence: Valence
) -> Earned | None:
    """Return what a session came to, never as a loss; None where nothing was judged.

    Points where they were won; else the steps that reached the goal; under the explicit type, and
    where no step did, the steps of the trained leg. A personal best is named, or the next mark
    above: the best so far or a round number, whichever is nearer. These steps have none.
    """
    slugs = ("score", "hit_rate", "steps")
    rows = SessionMetric.everywhere.filter(slug__in=slugs)
    figures = dict(rows.filter(session=session).values_list("slug", "value"))
    steps, points = round(figures.get("steps", 0)), round(figures.get("score", 0))
    if not steps:
        return None
    hits = round(figures.get("hit_rate", 0) * steps)
    if not valence.has_points or not hits:
        return Earned(format_number(steps, 0), label_steps(session, steps), "")
    earlier: dict[int, dict[str, float]] = defaultdict(dict)
    for key, slug, value in rows.filter(session__in=before.values("pk")).values_list(
        "session", "slug", "value"
    ):
        earlier[key][slug] = value
    if valence.rewards and points > 0:
        number, label = points, ngettext("point", "points", points)
        others = [one.get("score", 0) for one in earlier.values()]
    else:
        number, label = hits, ngettext("step at the goal", "steps at the goal", hits)
        others = [one.get("hit_rate", 0) * one.get("steps", 0) for one in earlier.values()]
    best = round(max(others, default=0))
    if others and number > best:
        mark = _("Your best so far!")
    else:
        mark = _("Next mark: %(count)s.") % {"count": format_number(next_mark(number, best), 0)}
    return Earned(format_number(number, 0), label, mark)


def label_steps(session: TrainingSession, steps: int) -> str:
    """Return what so many steps are: of the trained leg, in the active language."""
    if Side(session.trained_side) is Side.LEFT:
        return ngettext("step with your left leg", "steps with your left leg", steps)
    return ngettext("step with your right leg", "steps with your right leg", steps)


def next_mark(number: int, best: int) -> int:
    """Return the nearest mark above a number: the best so far, or the next round number."""
    size = 10 if number < 100 else 50 if number < 500 else 100
    round_one = (number // size + 1) * size
    return min(round_one, best) if best > number else round_one
