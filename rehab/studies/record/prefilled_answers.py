"""What GARRY itself knows of a study, as a protocol and a report say it. English, as registries."""

from __future__ import annotations

from typing import Any

from django.db.models import Max, Min

from rehab.studies.models import Study, StudyMark
from rehab.studies.participants import StudyEvent
from rehab.studies.record.report_statements import find
from rehab.studies.registration.document import FIRST_A2, describe
from rehab.studies.registration.estimands import (
    HARMS_FOLLOWED,
    METHOD,
    POPULATIONS,
    estimands,
    summary,
)
from rehab.studies.registration.outcome_changes import outcome_changes
from rehab.studies.registration.size import size_of_document
from rehab.studies.results.results import Results
from rehab.training.valences import find_valence

METHODS = {
    "blocks": "permuted blocks of random, sealed size",
    "minimization": "minimization with a random part",
    "list": "the study's own sealed list",
}
CONCEALED = (
    "Seed, block sizes or list are encrypted on the server, their SHA-256 is registered before the "
    "first participant; a group is drawn once a person is enrolled, and nobody knows it before."
)
EXPORTABLE = (
    "GARRY's export: outcomes of each visit under codes, their definitions, the protocol with all "
    "versions, reanalyze.py and reanalyze.R, which compute the results again."
)
UNMASKED = (
    "Participants and therapists are not blinded, nor is who takes the tests. What GARRY computes "
    "depends on nobody's judgment."
)


def know(study: Study, results: Results | None) -> dict[str, str]:
    """Return what is known, by slug.

    Parameters
    ----------
    study
        The study, registered or not.
    results
        Of a closed study; None before.
    """
    version = study.versions.last()
    document = version.document if version else describe(study)
    known = {**_planned(study, document), **_conducted(study)}
    if results is None:
        return known
    none = sum(not any(visit.is_walked for visit in one.visits) for one in results.participants)
    counted = f" ({none} of {len(results.participants)})"
    return known | find(study, results) | {"populations": POPULATIONS.format(counted=counted)}


def _planned(study: Study, document: dict[str, Any]) -> dict[str, str]:
    arms, visits = document["arms"], document["visits"]
    allocation, plan = document["allocation"], document.get("analysis", {})
    ratio = ":".join(str(group["weight"]) for group in allocation["groups"])
    framework = f"non-inferiority by {plan['margin']:g}" if "margin" in plan else "superiority"
    factors = ", ".join(factor["name"] for factor in allocation["factors"]) or "none"
    [primary, *others] = list(estimands(document))
    spending = plan.get("spending")
    walked: dict[str, str] = {}  # the arms of each sequence of phases
    for arm in arms:
        phases = _phases(arm["phases"])
        walked[phases] = f"{walked[phases]}, {arm['code']}" if phases in walked else arm["code"]
    follow_up, window = visits.get("days_to_follow_up"), visits.get("window_days")
    crossed = document["design"] == "crossover"
    return {
        "title": document["title"],
        "question": document["question"],
        "design": f"Randomized, {document['design']}, {len(arms)} arms, {ratio}, {framework}.",
        "arms": "; ".join(
            f"{arm['code']} ({arm['name']}): {_feedback(arm)}, shown at {arm['gain']:.0%}, robot's "
            f"gestures at {arm['robot_intensity']:.0%}"
            for arm in arms
        ),
        "phases": f"Goal: {document['goal_percent_of_baseline']:g} % of the baseline. "
        + "; ".join(f"{codes}: {phases}" for phases, codes in walked.items()),
        "eligibility": primary["population"],
        "primary": f"Primary: {primary['variable']}",
        "secondary": f"Secondary: {' '.join(one['variable'] for one in others) or 'none.'}",
        "timeline": f"Visits{' in each period' * crossed}: {visits['in_each_period']}, days "
        f"between them: {visits['days_between']}"
        + f", between periods: {visits['days_between_periods']}" * crossed
        + (f", to the follow-up: {follow_up}" if follow_up else "; no follow-up")
        + (f"; a visit may be off by days: {window}." if window is not None else "."),
        "participants": f"{document['participants']} participants are planned. "
        f"{size_of_document(document)}".strip(),
        "allocation": f"{METHODS[allocation['method']]}; factors: {factors}.",
        "sequence": "GARRY draws it from a seed of 128 random bits; the rule is in the protocol.",
        "concealment": CONCEALED,
        "implementation": "Therapists and leads enroll; GARRY assigns; assessors can do neither.",
        "analysis": f"{summary(document)} {METHOD}",
        "populations": POPULATIONS.format(counted=""),
        "missing": "As the model expects (at random); beside it how far missing visits would have "
        "to lie to change the conclusion by Holm's p (tipping point).",
        "further": "Exploratory outcomes are named so. "
        + "Carry-over is estimated. " * crossed
        + "No subgroups.",
        "collected": "Each stride is stored as it is walked; the software computes outcomes.",
        "looks": f"By alpha spending ({spending.replace('_', ' ')})."
        if spending
        else "None is planned.",
        "harms_defined": HARMS_FOLLOWED,
        "unblinding": "Two people, with a reason, logged; alone in an emergency, which is said.",
        "power": _power(study),
        "exportable": EXPORTABLE,
        "confidentiality": "Pseudonyms; exports by roles, logged; erasure on demand.",
        "consents": "Nobody is enrolled without a signed consent to the study, whose version, day "
        "and recorder are stored; a new version of the study may require another one before the "
        "next visit; whoever takes it back leaves the study.",
    }


def _feedback(arm: dict[str, Any]) -> str:
    """Return what an arm answers, and by how many points."""
    valence, measure = find_valence(arm["feedback_type"]), arm.get("measure_rule")
    edited = arm.get("feedback", {})
    hit, miss = (edited.get(n, getattr(valence, n)) for n in ("hit_points", "miss_points"))
    points = "no points" if hit is None else f"{hit:+} points for a hit, {miss:+} for a miss"
    name = measure["name"] if measure else FIRST_A2.name
    return f"{valence.slug} feedback of {name} ({points})"


def _power(study: Study) -> str:
    """Return what the latest simulation of the study's power assumed and found."""
    run = next((one for one in study.power_runs.all() if one.is_done), None)
    if run is None:
        return ""
    effects = ", ".join(f"{arm} {effect:g}" for arm, effect in run.settings["effects"].items())
    pairs = ", ".join(
        f"{one.group} - {one.reference} {one.power:.0%} [{one.low:.0%}, {one.high:.0%}]"
        for one in run.power
    )
    return (
        f"Power of {run.settings['participants']} people in {run.simulations} simulated studies, "
        f"by the same model, effects {effects} % of the baseline: {pairs}. {run.assumptions}"
    )


def _phases(phases: list[dict[str, Any]]) -> str:
    return ", ".join(
        f"{one['name']}{' without feedback' * (not one['feedback'])} ({_length(one)})"
        for one in phases
    )


def _length(phase: dict[str, Any]) -> str:
    strides, seconds = phase["strides"], phase["seconds"]
    known = (strides and f"{strides} strides", seconds and f"{seconds:g} s")
    return " or ".join(filter(None, known)) or "until the therapist ends it"


def _conducted(study: Study) -> dict[str, str]:
    versions = list(study.versions.order_by("number"))
    marks = study.marks.filter(ended_at=None)
    assessors = marks.filter(task=StudyMark.Task.ASSESSOR).count()
    changes = [f"version {v.number} ({v.at:%Y-%m-%d}): {v.reason}" for v in versions[1:]]
    enrolled = study.enrollments.aggregate(first=Min("enrolled_at"), last=Max("enrolled_at"))
    dates = {"registered": study.registered_at, "first enrollment": enrolled["first"]}
    if study.closed_at:
        walked = study.enrollments.aggregate(last=Max("visits__session__created_at"))
        dates |= {"last enrollment": enrolled["last"], "last visit": walked["last"]}
        dates |= {"closed": study.closed_at}
    known_days = {"first_day": enrolled["first"], "last_day": study.closed_at}
    looks = study.events.filter(kind=StudyEvent.Kind.LOOKED).order_by("pk")
    counts = list(dict.fromkeys(looks.values_list("about", flat=True)))
    return {name: f"{at:%Y-%m-%d}" for name, at in known_days.items() if at} | {
        "clinic": study.clinic.name,
        "version": f"Version {versions[-1].number}, {versions[-1].at:%Y-%m-%d}, SHA-256 "
        f"{versions[-1].digest}" if versions else "A draft.",
        "changes": "; ".join((*changes, *map(str, outcome_changes(study)))) or "None.",
        "dates": ", ".join(f"{name} {at:%Y-%m-%d}" for name, at in dates.items() if at),
        "status": str(study.state),
        "masked": f"Assessor-blinded: {assessors} marked." if assessors else UNMASKED,
        "blinded": "Who is marked as an assessor is kept from sessions, arms and boards by GARRY."
        if assessors
        else "GARRY keeps nothing from anybody: no assessor is marked.",
        "looks_made": f"Looked at results before the end after {', '.join(counts)} participants."
        if counts else "",
        "simulated": _simulated(study),
    }  # fmt: skip


def _simulated(study: Study) -> str:
    """Return how many participants are no people; "" where all are people."""
    simulated = study.enrollments.filter(patient__simulated=True).count()
    if not simulated:
        return ""
    if simulated == study.enrollments.count():
        return "Simulated: no participant was enrolled."
    return f"{simulated} of the participants are simulated."
