"""What GARRY itself knows of a study, as a protocol and a report say it. English, as registries."""

from __future__ import annotations

from collections import Counter
from statistics import mean, stdev
from typing import Any

from rehab.sessions.log import RobotEntry
from rehab.studies.analysis.comparison import Difference, Interval
from rehab.studies.analysis.designs import MIN_PARTICIPANTS
from rehab.studies.analysis.outcomes import OUTCOMES, scale_of
from rehab.studies.analysis.participants import Attendance
from rehab.studies.models import Arm, Study, StudyMark
from rehab.studies.participants import StudyEvent
from rehab.studies.registration.document import describe
from rehab.studies.registration.estimands import METHOD, estimands, summary
from rehab.studies.registration.outcome_changes import outcome_changes
from rehab.studies.results.harms_and_deviations import HARMS, label_of
from rehab.studies.results.results import Results

METHODS = {
    "blocks": "permuted blocks of random, sealed size",
    "minimization": "minimization with a random part",
    "list": "the study's own sealed list",
}
CONCEALED = (
    "Seed, block sizes or list are encrypted on the server, their SHA-256 is registered before the "
    "first participant; a group is drawn when a person is enrolled, and shown to nobody."
)
UNADJUSTED = (
    "95 % intervals not adjusted for multiplicity; of shares cut at none and all. Means and "
    "differences by the model."
)
POPULATIONS = (
    "Intention to treat: all allocated who walked at least one visit{counted}, as allocated. Per "
    "protocol: without visits that deviated."
)
UNMASKED = "Outcome computed by software, participants and therapists not blinded."
HARMS_FOLLOWED = (
    "Falls, near falls, dizziness, pain and stops of the robot follow from the sessions' logs by "
    "themselves and are offered as adverse events, each with severity, relation, expectedness and "
    "the day by which it has to be reported."
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
    return known | (_found(study, results) if results is not None else {})


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
    follow_up, crossed = visits.get("days_to_follow_up"), document["design"] == "crossover"
    return {
        "title": document["title"],
        "question": document["question"],
        "design": f"Randomized, {document['design']}, {len(arms)} arms, {ratio}, {framework}.",
        "arms": "; ".join(
            f"{arm['code']} ({arm['name']}): {arm['feedback_type']} feedback of {arm['measure']}, "
            f"shown at {arm['gain']:.0%}, robot's gestures at {arm['robot_intensity']:.0%}"
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
        + (f", to the follow-up: {follow_up}." if follow_up else "; no follow-up."),
        "participants": f"{document['participants']} participants are planned.",
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
        "looks": f"By alpha spending ({spending.replace('_', ' ')})." if spending else "None.",
        "harms_defined": HARMS_FOLLOWED,
        "unblinding": "Two people, with a reason, logged; alone in an emergency, which is said.",
        "confidentiality": "Pseudonyms; exports by roles, logged; erasure on demand.",
        "consents": "Each consent to research names its text's version; a new version of the study "
        "may require each participant's consent before the next visit.",
    }


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
    dates = {
        "registered": study.registered_at,
        "first enrollment": study.enrollments.order_by("enrolled_at").values_list(
            "enrolled_at", flat=True
        ).first(),
        "closed": study.closed_at,
    }  # fmt: skip
    return {
        "clinic": study.clinic.name,
        "version": f"Version {versions[-1].number}, {versions[-1].at:%Y-%m-%d}, SHA-256 "
        f"{versions[-1].digest}" if versions else "A draft.",
        "changes": "; ".join((*changes, *map(str, outcome_changes(study)))) or "None.",
        "dates": ", ".join(f"{name} {at:%Y-%m-%d}" for name, at in dates.items() if at),
        "status": str(study.state),
        "masked": f"Assessor-blinded: {assessors} marked." if assessors else UNMASKED,
        "blinded": "Who is marked as an assessor is kept from sessions, arms and boards by GARRY.",
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


def _found(study: Study, results: Results) -> dict[str, str]:
    flow, assessed = results.flow, results.assessed
    kinds = StudyEvent.Kind
    revealed = study.events.filter(kind__in=(kinds.UNBLINDED, kinds.EMERGENCY))
    alone = revealed.filter(about="alone").count()
    walked = sum(any(visit.is_walked for visit in one.visits) for one in results.participants)
    return {
        "flow": f"{assessed.people} assessed, {assessed.turned_away} turned away; "
        + "; ".join(
            f"{one.arm}: {one.allocated} allocated, {one.never_began} never began, "
            f"{one.began} began, {one.completed} completed, {one.analyzed} analyzed"
            for one in flow
        ),
        "populations": POPULATIONS.format(counted=f" ({walked} of {len(results.participants)})"),
        "losses": "; ".join(
            f"{one.arm}: {one.never_began} never began, {one.left} left later, {one.removed} "
            f"removed; {len(_visits(results, one.arm, Attendance.MISSED))} visits missed, "
            f"{one.visits_excluded} excluded"
            for one in flow
        ),
        "delivered": "; ".join(
            f"{one.arm}: {one.visits_walked} of {one.visits_planned} visits walked, "
            f"{one.visits_unfinished} ended early"
            for one in flow
        ),
        "baseline": "; ".join(filter(None, (_baseline(results, arm) for arm in study.arms.all()))),
        "estimates": " ".join(
            (*(_estimates(results, slug) for slug in results.registered), UNADJUSTED)
        ),
        "harms_found": _harms(results),
        "unblinded": f"{revealed.count()} arms revealed, {alone} of them by one person alone.",
        "ended": f"Closed on {study.closed_at:%Y-%m-%d}." if study.closed_at else "",
    }


def _harms(results: Results) -> str:
    """Return how often each harm was noted in each arm, also those that never were."""
    counts = {row.what: row.counts for row in results.conduct}
    came = {
        arm: _visits(results, arm) - _visits(results, arm, Attendance.MISSED)
        for arm in results.arms
    }
    return "; ".join(
        f"{label_of(harm)}: "
        + ", ".join(
            f"{arm} {events} events in {people} of {len({code for code, _visit in visits})} "
            f"participants ({len(visits)} visits)"
            for arm, visits in came.items()
            for events, people in [counts.get(harm, {}).get(arm, (0, 0))]
        )
        for harm in (*map(str, HARMS), RobotEntry.STOP.value)
    )


def _visits(
    results: Results, arm: str, attendance: Attendance | None = None
) -> set[tuple[str, int]]:
    """Return participant and number of an arm's visits that were due; of one attendance, or all."""
    return {
        (one.code, visit.number)
        for one in results.participants
        for visit in (one.visits if one.is_analyzed else ())
        if (visit.arm, visit.is_due) == (arm, True) and attendance in {None, visit.attendance}
    }


def _baseline(results: Results, arm: Arm) -> str:
    """Return how many have a first baseline in an arm, with its mean and standard deviation."""
    people = (one for one in results.participants if one.is_analyzed and arm.code in one.arms)
    found = [one.baseline for one in people if one.baseline is not None]
    if len(found) < MIN_PARTICIPANTS:
        return ""
    of_arm = f"{mean(found):.3g} (SD {stdev(found):.2g})"
    return f"{arm.code}: {len(found)} people, {arm.measure.name} {of_arm} {arm.measure.unit}"


def _estimates(results: Results, slug: str) -> str:
    """Return an outcome's numbers, means and differences, with 95 % intervals."""
    found, label, unit = results.find(slug), OUTCOMES[slug][0], scale_of(slug)
    means = (
        f"{one.arm} {one.participants} people ({_by_visit(results, slug, one.arm)}), adjusted mean "
        f"{_text(one.mean)}"
        for one in found.arms
    )
    apart = (
        f"{one.group} - {one.reference} {_text(one.difference)}" + _p(results, slug, one)
        for one in found.differences
    )
    status = results.registered[slug].status
    return f"{label}{unit and f' [{unit}]'} ({status}): {'; '.join((*means, *apart))}."


def _by_visit(results: Results, slug: str, arm: str) -> str:
    """Return how many have an outcome at each visit in an arm."""
    visits = [visit for one in results.participants for visit in one.visits if visit.arm == arm]
    counts = Counter(visit.number for visit in visits if slug in visit.outcomes)
    return ", ".join(f"visit {number}: {counts[number]}" for number in sorted(counts))


def _p(results: Results, slug: str, one: Difference) -> str:
    adjusted = results.adjusted_p.get((slug, one.group, one.reference))
    return "" if one.p is None or adjusted is None else f", p {one.p:.2g} (Holm {adjusted:.2g})"


def _text(found: Interval | None) -> str:
    if found is None:
        return "no mean"
    if found.low is None or found.high is None:
        return f"{found.estimate:.3g}"
    return f"{found.estimate:.3g} [{found.low:.3g}, {found.high:.3g}]"
