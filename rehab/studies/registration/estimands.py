"""What exactly each outcome of a registered study estimates, in the five parts of ICH E9 (R1)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rehab.questionnaires.standard_tests import ClinicalTest
from rehab.studies.analysis.outcomes import Outcome, outcomes_with
from rehab.studies.models import NOT

SUMMARY = {
    "parallel": "Difference of the arms' means over the visits that all arms have, adjusted for "
    "visit and first baseline.",
    "crossover": "Difference within people between the arms, adjusted for visit and with it the "
    "period.",
}
EVENTS = (
    ("a session ends early, or deviates from the plan", "treatment policy: counted as it was"),
    ("a visit is missed, also after leaving", "hypothetical: as if it had been walked, given all "
     "that was seen of the person (missing at random); beside it the tipping point"),
    ("a person wanted the data removed", "not in the population: nothing may be used"),
    ("the arm was revealed", "treatment policy; left out per protocol"),
)  # fmt: skip
METHOD = (
    "Linear mixed model by restricted maximum likelihood with variances of each arm's own and the "
    "small-sample correction of Kenward and Roger by the observed information; two-sided at 5 %. "
    "Secondary outcomes, and pairs of several arms, by Holm. Per protocol: without visits that "
    "deviated."
)
POPULATIONS = (
    "Intention to treat: everybody as allocated. Who walked no visit{counted} adds nothing to the "
    "model's estimate, and counts as missing in the tipping point. Per protocol: without visits "
    "that deviated."
)
HARMS_FOLLOWED = (
    "Falls, near falls, dizziness, pain and stops of the robot follow from the sessions' logs by "
    "themselves and are offered as adverse events, each with severity, relation, expectedness and "
    "the day by which it has to be reported."
)


def summary(document: dict[str, Any]) -> str:
    """Return what is estimated of each outcome. ``document``: of a study's version."""
    text = SUMMARY[document["design"]]
    if document["design"] == "parallel" and document["allocation"]["factors"]:
        return text.replace(" and first baseline", ", first baseline and strata of the allocation")
    return text


def outcomes_of(document: dict[str, Any]) -> dict[str, Outcome]:
    """Return all that a version may name as outcome, with the own tests as they were registered."""
    return outcomes_with(ClinicalTest.from_json(one) for one in document.get("tests", ()))


def registered_outcomes(document: dict[str, Any]) -> list[str]:
    """Return the slugs of a version's outcomes, the primary one first, each once."""
    return list(dict.fromkeys((document["primary_outcome"], *document["secondary_outcomes"])))


def estimands(document: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the estimand of each registered outcome, the primary one first.

    Parameters
    ----------
    document
        Of a study's version.
    """
    outcomes = outcomes_of(document)
    people = [*document.get("inclusion", ()), *(f"{NOT}{o}" for o in document.get("exclusion", ()))]
    if months := document["months_since_stroke_at_least"]:
        people.insert(0, f"{months} months or more since the stroke")
    for slug in registered_outcomes(document):
        yield {
            "outcome": slug,
            "population": "; ".join(people) or "every patient of the clinic who consents",
            "treatments": [f"{arm['code']}: {arm['name']}" for arm in document["arms"]],
            "variable": f"{one.name}: {one.meaning}" if (one := outcomes.get(slug)) else slug,
            "intercurrent_events": dict(EVENTS),
            "summary": summary(document),
        }
