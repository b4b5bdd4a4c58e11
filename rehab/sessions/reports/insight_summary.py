"""What the insight page shows, in a sentence above the table."""

from __future__ import annotations

from collections.abc import Sequence

from django.utils.translation import gettext

from rehab.sessions.formatting import format_rate
from rehab.sessions.reports.insight import Group
from rehab.sessions.reports.intervals import MeanInterval


def summarize_groups(groups: Sequence[Group]) -> str:
    """Return which group's hit rate is highest and lowest, and whether their intervals differ.

    Empty where there are no two groups with a hit rate, and where none has an interval: the page
    then says that there is too little data, and no more.
    """
    rated = [(one.hit_rate.mean, one.hit_rate, one.label) for one in groups if one.hit_rate]
    if len(rated) < 2 or all(rate.low is None for _mean, rate, _label in rated):
        return ""
    high, low = max(rated, key=lambda one: one[0]), min(rated, key=lambda one: one[0])
    words = gettext("Highest: %(best)s, %(high)s. Lowest: %(worst)s, %(low)s.") % {
        "best": high[2],
        "high": format_rate(high[0]),
        "worst": low[2],
        "low": format_rate(low[0]),
    }
    return f"{words} {_tell_apart(high[1], low[1])}"


def _tell_apart(high: MeanInterval, low: MeanInterval) -> str:
    """Return whether the intervals of two groups overlap."""
    if high.low is None or low.high is None:
        return gettext("One of them has too few to compare: this shows no difference.")
    if high.low > low.high:
        return gettext("Their likely ranges do not overlap.")
    return gettext("Their likely ranges overlap: this shows no difference.")
