"""How many participants a plan needs by formula, in words.

A plan is a mapping: ``planned_sd``, ``margin`` and ``assumed``, as documents and studies have them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from django.utils.formats import number_format
from django.utils.translation import gettext

from rehab.studies.analysis.sample_size import Assumed, Size, size_of
from rehab.studies.models import Study
from rehab.training.measures import InvalidSetting

Groups = Sequence[tuple[int, int]]  # of each: its part of the ratio, how many arms it walks


def read_assumed(plan: Mapping[str, Any]) -> Assumed | None:
    """Return what a plan's size rests on; None without an SD, or a difference or a margin.

    Raises InvalidSetting for values out of bounds.
    """
    assumed, sd = plan.get("assumed") or {}, plan.get("planned_sd")
    difference = plan.get("margin") or assumed.get("difference")
    if not (sd and difference):
        return None
    return Assumed(**assumed | {"difference": difference, "sd": sd})


def find_size(plan: Mapping[str, Any], groups: Groups) -> tuple[Size, str] | None:
    """Return how many participants a plan needs, and in words why; None where it says too little.

    Raises InvalidSetting for what has no size.
    """
    assumed, walked = read_assumed(plan), groups[0][1]
    if assumed is None:
        return None
    size = size_of(assumed, [weight for weight, _arms in groups], walked=walked)
    return size, _words(assumed, size, walked=walked)


def size_of_study(study: Study) -> tuple[Size, str] | None:
    """Return the same of a study; None, too, where it has none."""
    plan = {name: getattr(study, name) for name in ("planned_sd", "margin", "assumed")}
    try:
        return find_size(plan, [(group.weight, len(group.arms)) for group in study.groups()])
    except InvalidSetting:
        return None


def size_of_document(document: Mapping[str, Any]) -> str:
    """Return the words of a registered document; "" of one that does not say what it assumed."""
    plan, groups = document.get("analysis", {}), document["allocation"]["groups"]
    if "assumed" not in plan:
        return ""
    found = find_size(plan, [(group["weight"], len(group["arms"])) for group in groups])
    return found[1] if found else ""


def _words(assumed: Assumed, size: Size, *, walked: int) -> str:
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
        "%(finish)d participants with the outcome give a power of %(power)s %% for a difference or "
        "margin of %(difference)s, at an SD of %(sd)s between people and a two-sided alpha of "
        "%(alpha)s %%. Where %(dropout)s %% leave, that takes %(enrolled)d."
    )
    kind = gettext("Formula: t test of two groups, Julious 2004 (Stat Med 23:1921).")
    if walked > 1:
        kind = gettext(
            "Formula: t test within people, whose outcomes correlate by %(correlation)s, Julious "
            "2004 (Stat Med 23:1921)."
        ) % {"correlation": number_format(f"{assumed.correlation:g}")}
    return f"{found % numbers} {kind}"
