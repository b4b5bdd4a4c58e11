"""What the insight page shows, in a sentence above the table."""

from __future__ import annotations

from collections.abc import Sequence

from django.utils.translation import gettext

from rehab.sessions.formatting import format_rate
from rehab.sessions.reports.insight import Group


def summarize_groups(groups: Sequence[Group]) -> str:
    """Return which group's hit rate is highest and lowest, where their intervals tell them apart.

    Else that they do not. Empty where there are no two groups with a hit rate, and where none has
    an interval: the page then says that there is too little data, and no more.
    """
    rated = [(one.hit_rate.mean, one.hit_rate, one.label) for one in groups if one.hit_rate]
    if len(rated) < 2 or all(rate.low is None for _mean, rate, _label in rated):
        return ""
    high, low = max(rated, key=lambda one: one[0]), min(rated, key=lambda one: one[0])
    if high[1].low is None or low[1].high is None:
        return gettext("The highest or the lowest has too few to compare: no difference is shown.")
    if high[1].low <= low[1].high:
        return gettext("Highest and lowest: their likely ranges overlap, no difference is shown.")
    words = gettext("Highest: %(best)s, %(high)s. Lowest: %(worst)s, %(low)s.") % {
        "best": high[2],
        "high": format_rate(high[0]),
        "worst": low[2],
        "low": format_rate(low[0]),
    }
    apart = gettext("Their likely ranges do not overlap.")
    return f"{words} {apart}"
