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


def size_of_study(study: Study) -> Size | None:
    """Return how many participants a study's plan needs; None where nothing says so."""
    try:
        assumed, groups = assumed_of(study), study.groups()
    except InvalidSetting:
        return None
    return _size(assumed, [(group.weight, len(group.arms)) for group in groups])


def tell_size(study: Study) -> str:
    """Return the same in words, and why; "" where nothing says so."""
    size = size_of_study(study)
    assumed = None if size is None else assumed_of(study)
    if size is None or assumed is None:
        return ""
    return size_words(assumed, size, walked=len(study.groups()[0].arms))


def size_of_document(document: dict[str, Any]) -> str:
    """Return the words of a registered document."""
    plan = document.get("analysis", {})
    assumed = make_assumed(plan.get("planned_sd"), plan.get("margin"), plan.get("assumed", {}))
    groups = [(one["weight"], len(one["arms"])) for one in document["allocation"]["groups"]]
    size = _size(assumed, groups)
    if size is None or assumed is None or "assumed" not in plan:
        return ""
    return size_words(assumed, size, walked=groups[0][1])


def _size(assumed: Assumed | None, groups: list[tuple[int, int]]) -> Size | None:
    """Return the size; ``groups``: the part of the ratio of each, and how many arms it walks."""
    if assumed is None:
        return None
    try:
        return size_of(assumed, [weight for weight, _arms in groups], walked=groups[0][1])
    except InvalidSetting:
        return None


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
