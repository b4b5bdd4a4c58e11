"""How many participants a plan needs by formula, in words."""

from __future__ import annotations

from typing import Any

from django.utils.formats import number_format
from django.utils.translation import gettext

from rehab.studies.analysis.sample_size import Assumed, Size, size_of
from rehab.studies.models import Study
from rehab.training.measures import InvalidSetting


def make_assumed(sd: float | None, margin: float | None, assumed: dict[str, Any]) -> Assumed | None:
    """Return what a size rests on; None without an SD, or without a difference or a margin.

    Raises InvalidSetting for values out of bounds.
    """
    difference = margin or assumed.get("difference")
    if not (sd and difference):
        return None
    return Assumed(**assumed | {"difference": difference, "sd": sd})


def assumed_of(study: Study) -> Assumed | None:
    """Return what a study's size rests on; None where that was not said."""
    return make_assumed(study.planned_sd, study.margin, study.assumed)


def tell_size(study: Study) -> str:
    """Return how many participants a study's plan needs, and why; "" where that was not said."""
    try:
        assumed, groups = assumed_of(study), study.groups()
    except InvalidSetting:
        return ""
    return _tell(assumed, [(group.weight, len(group.arms)) for group in groups])


def size_of_document(document: dict[str, Any]) -> str:
    """Return the same of a registered document."""
    plan = document.get("analysis", {})
    if "assumed" not in plan:
        return ""
    assumed = make_assumed(plan.get("planned_sd"), plan.get("margin"), plan["assumed"])
    groups = document["allocation"]["groups"]
    return _tell(assumed, [(group["weight"], len(group["arms"])) for group in groups])


def _tell(assumed: Assumed | None, groups: list[tuple[int, int]]) -> str:
    """Return the words; ``groups``: the part of the ratio of each, and how many arms it walks."""
    if assumed is None:
        return ""
    walked = groups[0][1]
    try:
        size = size_of(assumed, [weight for weight, _arms in groups], walked=walked)
    except InvalidSetting:
        return ""
    return size_words(assumed, size, walked=walked)


def size_words(assumed: Assumed, size: Size, *, walked: int) -> str:
    """Return a size, what it rests on, and the source of the formula.

    Parameters
    ----------
    assumed, size
        As `size_of` took and gave them.
    walked
        How many arms everybody walks.
    """
    numbers: dict[str, object] = {
        "finish": size.finish,
        "enrolled": size.enrolled,
        "difference": number_format(f"{abs(assumed.difference):g}"),
        "sd": number_format(f"{assumed.sd:g}"),
        "power": f"{100 * assumed.power:g}",
        "alpha": number_format(f"{100 * size.alpha:.3g}"),
        "dropout": f"{100 * assumed.dropout:g}",
    }
    found = gettext(
        "%(finish)d participants with the outcome find a difference of %(difference)s in "
        "%(power)s %% of studies, at an SD of %(sd)s between people and a two-sided alpha of "
        "%(alpha)s %%. Where %(dropout)s %% leave, that takes %(enrolled)d."
    )
    kind = gettext("Formula: t test of two groups, Julious 2004 (Stat Med 23:1921).")
    if walked > 1:
        kind = gettext(
            "Formula: t test within people, whose outcomes correlate by %(correlation)s, Julious "
            "2004 (Stat Med 23:1921)."
        ) % {"correlation": number_format(f"{assumed.correlation:g}")}
    return f"{found % numbers} {kind}"
