"""Falls and exertion that were noted in sessions, as text."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from django.utils.translation import gettext, ngettext

from rehab.people.models import User
from rehab.sessions.formatting import format_number
from rehab.sessions.log import Remark, SessionEvent
from rehab.sessions.models import TrainingSession

FALLS = {Remark.FALL: 1, Remark.FALL_WITHDRAWN: -1}


def describe_noted(user: User, sessions: Sequence[TrainingSession]) -> dict[int, str]:
    """Return how often a session's patient fell, and the exertion that was noted, by its key.

    Sessions in which neither was noted are left out. A fall that was withdrawn was none.
    """
    falls: defaultdict[int, int] = defaultdict(int)
    borg: defaultdict[int, list[float]] = defaultdict(list)
    rows = SessionEvent.objects.visible_to(user).filter(
        session__in=[session.pk for session in sessions], kind__in=[*FALLS, Remark.BORG]
    )
    for session_id, kind, value in rows.order_by("pk").values_list("session_id", "kind", "value"):
        if kind == Remark.BORG:
            borg[session_id].append(value or 0)
        else:
            falls[session_id] += FALLS[Remark(kind)]
    return {
        key: " · ".join(_describe(falls.get(key, 0), borg.get(key, [])))
        for key in falls.keys() | borg.keys()
        if falls.get(key, 0) > 0 or key in borg
    }


def _describe(falls: int, borg: Sequence[float]) -> list[str]:
    parts = []
    if falls > 0:
        parts.append(ngettext("%(count)s fall", "%(count)s falls", falls) % {"count": falls})
    if borg:
        low, high = format_number(min(borg), 0), format_number(max(borg), 0)
        felt = low if low == high else f"{low}–{high}"
        parts.append(gettext("Borg %(felt)s") % {"felt": felt})
    return parts
