"""The choices of a leaderboard's settings."""

from __future__ import annotations

from typing import Any

from django.db.models import TextChoices
from django.utils.translation import gettext_lazy as _

from rehab.training.summary.metrics import METRICS

FEWEST_PATIENTS = 5  # whose results a board shows together
METRIC_LABELS = {
    "hit_rate": _("Steps at the goal (%)"),
    "mean_performance": _("Mean step, in % of the own goal"),
    "improvement_over_baseline": _("Improvement over the own baseline (%)"),
    "retention_in_washout": _("Improvement kept in the washout (%)"),
    "active_minutes": _("Minutes walked"),
    "target_met": _("Days on which the target was met"),
}


class Participants(TextChoices):
    """Whose sessions are on a board."""

    SELF = "self", _("The patient's own sessions")
    GROUP = "group", _("A group of patients")
    CLINIC = "clinic", _("All patients of the clinic")
    ACROSS = "across", _("Patients of several clinics")


class CountedTypes(TextChoices):
    """Which feedback types count on a board."""

    SAME = "same", _("The type just walked")
    CHOSEN = "chosen", _("Chosen types")
    ALL = "all", _("All types")


class Aggregation(TextChoices):
    """How a patient's sessions become a row."""

    EACH = "each", _("Each session")
    BEST = "best", _("Best session")
    LATEST = "latest", _("Latest session")
    MEAN = "mean", _("Mean of the last sessions")
    SUM = "sum", _("Sum over the period")


class PeriodKind(TextChoices):
    """Over which days sessions count."""

    ALL = "all", _("All time")
    DAYS_30 = "days_30", _("Last 30 days")
    WEEK = "week", _("This week")
    MONTH = "month", _("This month")
    DATES = "dates", _("Between two dates")


class TieRule(TextChoices):
    """How equal figures are ranked."""

    STANDARD = "standard", "1, 2, 2, 4"
    DENSE = "dense", "1, 2, 2, 3"
    EARLIER = "earlier", _("1, 2, 3, 4: the earlier first")


class DisplayMode(TextChoices):
    """Which rows are shown."""

    NEIGHBORS = "neighbors", _("You and two on each side")
    TOP = "top", _("The best")
    TOP_AND_ME = "top_and_me", _("The best, and you")
    TOTAL = "total", _("One total, reached together")


class NameStyle(TextChoices):
    """What patients are called."""

    PSEUDONYM = "pseudonym", _("Animal names")
    INITIALS = "initials", _("Initials")
    CODE = "code", _("Codes")


class Occasion(TextChoices):
    """When a board is shown."""

    AFTER_SESSION = "after_session", _("After a session")
    WAITING = "waiting", _("While the tablet waits")
    PT_ONLY = "pt_only", _("Only here, for therapists")


def metric_choices() -> list[tuple[str, Any]]:
    """Return the metrics that can be ranked by, the hit rate first."""
    slugs = sorted(METRICS, key=lambda slug: slug != "hit_rate")
    return [(slug, METRIC_LABELS.get(slug, _(METRICS[slug].label))) for slug in slugs]
