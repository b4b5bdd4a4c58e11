"""All that keeps a plan from being registered, at once; and what is registered with a reason."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from django.utils.translation import gettext

from rehab.people.web.refusals import format_refusal
from rehab.studies.allocation.scheme import Method
from rehab.studies.models import Study
from rehab.studies.registration.allocation_secret import unseal
from rehab.studies.registration.document import describe, describe_arm
from rehab.studies.registration.measurable import find_unmeasurable
from rehab.studies.registration.size import size_of_study
from rehab.training.measures import InvalidSetting

DECIDES = {Method.BLOCKS: "block_sizes", Method.LIST: "allocation_list"}  # of an allocation


@dataclass(frozen=True, slots=True)
class Problem:
    """Why a plan cannot be registered, and the field of its page that mends it."""

    words: str
    field: str


class UnfitPlan(InvalidSetting):
    """A plan that cannot be registered, with all its `problems`."""

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__(" ".join(one.words for one in problems))
        self.problems = problems


def check_plan(study: Study) -> None:
    """Raise UnfitPlan for a study that could not be run, or could not find an outcome."""
    if problems := find_problems(study):
        raise UnfitPlan(problems)


def find_problems(study: Study) -> list[Problem]:
    """Return all that keeps a study from being registered, each reason once."""
    found: dict[str, Problem] = {}
    for words, field in _problems(study):
        found.setdefault(words, Problem(words, field))
    return list(found.values())


def _problems(study: Study) -> Iterator[tuple[str, str]]:
    yield from _tried(study.groups, "arm-0-valence")
    for row, arm in enumerate(study.arms.select_related("measure", "protocol")):
        yield from _tried(partial(describe_arm, study, arm), f"arm-{row}-protocol")
        if study.follow_up_days is not None:
            yield from _tried(arm.baseline, f"arm-{row}-protocol")
    yield from _tried(lambda: study.visit_plan, "visits")
    if study.sealed:
        field = DECIDES.get(Method(study.method), "factors_text")
        yield from _tried(lambda: study.scheme().check_secret(unseal(study.sealed)), field)
    for slug in dict.fromkeys((study.primary_outcome, *study.secondary_outcomes)):
        is_primary = slug == study.primary_outcome
        try:
            for words in find_unmeasurable(study, slug):
                yield words, "primary_outcome" if is_primary else "secondary_outcomes"
        except InvalidSetting:  # an arm's, which was told above
            continue
    yield from _tried(lambda: describe(study), "arm-0-valence")


def _tried(act: Callable[[], Any], field: str) -> Iterator[tuple[str, str]]:
    try:
        act()
    except InvalidSetting as problem:
        yield format_refusal(problem), field


def find_doubts(study: Study) -> dict[str, str]:
    """Return what a reviewer would ask of a plan that can be registered, by the fact it lacks."""
    found = {}
    sized = size_of_study(study)
    if sized is not None and sized[0].enrolled > study.participants:
        found["size"] = gettext(
            "%(planned)d participants are planned where the formula asks for %(needed)d."
        ) % {"planned": study.participants, "needed": sized[0].enrolled}
    if not study.criteria:
        found["everybody"] = gettext("No criteria say who may take part.")
    return {slug: words for slug, words in found.items() if not study.facts.get(slug)}
