"""What a closed study found, as its report says it. English, as journals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from statistics import mean, stdev
from typing import Any

from rehab.people.covariates import age_band, months_since
from rehab.sessions.log import RobotEntry
from rehab.studies.agreements import WITHDRAWN
from rehab.studies.analysis.comparison import Difference, Interval
from rehab.studies.analysis.design_matrix import MIN_PARTICIPANTS
from rehab.studies.analysis.participants import ArmFlow, Attendance
from rehab.studies.guesses import guess_rows
from rehab.studies.models import Arm, Study
from rehab.studies.participants import StudyEvent
from rehab.studies.record.adverse_events import Relation, listing_rows
from rehab.studies.registration.allocation_secret import unseal
from rehab.studies.results.harms_and_deviations import HARMS, label_of
from rehab.studies.results.results import Results
from rehab.training.measures import InvalidSetting

UNADJUSTED = (
    "95 % intervals not adjusted for multiplicity; of shares cut at none and all. Means and "
    "differences by the model."
)
# Outcomes that say how much was trained.
DOSE = {"steps": "judged strides", "active_minutes": "minutes"}
REASONS = "Reasons, as they were typed, are among the study's events; write them without names."


def find(study: Study, results: Results) -> dict[str, str]:
    """Return what is found, by slug. ``results``: of the study, which is closed."""
    flow, assessed = results.flow, results.assessed
    kinds = StudyEvent.Kind
    revealed = study.events.filter(kind__in=(kinds.UNBLINDED, kinds.EMERGENCY))
    alone = revealed.filter(about="alone").count()
    back = study.events.filter(kind=kinds.WITHDRAWN, about=WITHDRAWN)
    groups = Counter(back.values_list("enrollment__allocation__group", flat=True))
    reasons = "".join(f", {count} {reason}" for reason, count in assessed.reasons.most_common())
    return {
        "flow": f"{assessed.people} assessed, {assessed.turned_away} turned away "
        f"({assessed.not_eligible} not eligible{reasons}; {assessed.declined} declined); "
        + "; ".join(
            f"{one.arm}: {one.allocated} allocated, {one.never_began} never began, "
            f"{one.began} began, {one.completed} completed, {one.analyzed} analyzed"
            for one in flow
        ),
        "losses": "; ".join(
            f"{one.arm}: {one.never_began} never began, {one.left} left later, {one.removed} "
            f"removed, {_of_arm(groups, one.arm)} took the consent back; "
            f"{len(_visits(results, one.arm, Attendance.MISSED))} visits missed, "
            f"{one.visits_excluded} excluded"
            for one in flow
        )
        + f". {REASONS}",
        "delivered": "; ".join(_delivered(results, one) for one in flow)
        + f". Deviations: {_deviations(results)}.",
        "baseline": "; ".join(
            filter(None, (_baseline(study, results, arm) for arm in study.arms.all()))
        ),
        "estimates": " ".join(
            (*(_estimates(results, slug) for slug in results.registered), UNADJUSTED)
        ),
        "ancillary": _sensitivity(results),
        "harms_found": _harms(results),
        "adverse": _adverse(study),
        "unblinded": f"{revealed.count()} arms revealed, {alone} of them by one person alone."
        + _guesses(study),
        "sizes": _sizes(study),
        "looks_level": ""
        if results.level is None or not study.spending
        else f"The primary outcome is found at the end where p is below {results.level:.4f}.",
        "ended": f"Closed on {study.closed_at:%Y-%m-%d}, with {len(results.participants)} of "
        f"{study.participants} participants.",
    }


def _of_arm(groups: Counter[str], arm: str) -> int:
    """Return how many of some people were allocated to an arm, or to begin with it."""
    return sum(count for group, count in groups.items() if group.split("-")[0] == arm)


def _delivered(results: Results, flow: ArmFlow) -> str:
    """Return how many visits of an arm were walked, and how far."""
    visits = [v for one in results.participants for v in one.visits if v.arm == flow.arm]
    dose = {name: [v.outcomes[name] for v in visits if name in v.outcomes] for name in DOSE}
    means = (f"{mean(values):.0f} {DOSE[name]}" for name, values in dose.items() if values)
    return (
        f"{flow.arm}: {flow.visits_walked} of {flow.visits_planned} visits walked, "
        f"{flow.visits_unfinished} ended early" + "".join(f", {one} a visit" for one in means)
    )


def _deviations(results: Results) -> str:
    rows = [row for row in results.conduct if row.kind == "deviation"]
    told = (
        f"{row.label} "
        + ", ".join(f"{arm} {events} in {people}" for arm, (events, people) in row.counts.items())
        for row in rows
    )
    return "; ".join(told) or "none"


def _sensitivity(results: Results) -> str:
    """Return the primary outcome per protocol, and how far missing visits would have to lie."""
    outcome, parts = results.find(results.primary), []
    for one in outcome.differences:
        followed, point = outcome.of_protocol(one), results.tipping_point(results.primary, one)
        kept = _text(followed.difference) if followed else "not told"
        shift = "no tipping point" if point is None else f"tipping point {point:.3g}"
        parts.append(f"{one.group} - {one.reference} {kept}, {shift}")
    told = (
        "Primary outcome per protocol, and the shift of missing visits that changes the conclusion"
    )
    return f"{told}: {'; '.join(parts)}." if parts else ""


def _adverse(study: Study) -> str:
    """Return the adverse events that were judged, by arm and kind."""
    found: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in listing_rows(study, by_arm=True):
        found.setdefault((row["arm"], row["what"]), []).append(row)
    told = (
        f"{arm} {what or 'erased'}: {len(rows)} in "
        f"{len({row['participant'] for row in rows})} participants, highest grade "
        f"{max(row['grade'] for row in rows)}, {sum(row['serious'] for row in rows)} serious, "
        f"{sum(row['relation'] != Relation.NONE for row in rows)} related, "
        f"{sum(not row['expected'] for row in rows)} unexpected"
        for (arm, what), rows in sorted(found.items())
    )
    return f"Adverse events as they were judged: {'; '.join(told) or 'none'}."


def _guesses(study: Study) -> str:
    told = (
        f" {row['guesser'].capitalize()}s' guesses, James's index {row['estimate']:.2f} "
        f"[{row['low_95']:.2f}, {row['high_95']:.2f}]."
        for row in guess_rows(study)
        if row["index"] == "James" and row["estimate"] is not None
    )
    return "".join(told)


def _sizes(study: Study) -> str:
    """Return the sizes of blocks, which are told once nobody is allocated any more."""
    try:
        sizes = unseal(study.sealed).block_sizes
    except InvalidSetting:  # another server's key
        return ""
    return f"Sizes of blocks: {', '.join(map(str, sizes))}." if sizes else ""


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


def _baseline(study: Study, results: Results, arm: Arm) -> str:
    """Return who was allocated to an arm: first baseline, age, time since the stroke, severity."""
    people = [one for one in results.participants if one.is_analyzed and arm.code in one.arms]
    if len(people) < MIN_PARTICIPANTS:
        return ""
    rows = study.enrollments.filter(code__in=[one.code for one in people])
    patients = [(one.patient, one.enrolled_at.date()) for one in rows.select_related("patient")]
    ages = [age_band(patient.birth_year, day) for patient, day in patients]
    months = [months_since(patient.stroke_month, day) for patient, day in patients]
    found = (
        _mean([one.baseline for one in people], f"{arm.measure.name} [{arm.measure.unit}]"),
        _shares(ages, "years of age"),
        _mean(months, "months since the stroke"),
        _shares([patient.severity for patient, _day in patients], "severity"),
        _shares([patient.paretic_side for patient, _day in patients], "paretic side"),
    )
    return f"{arm.code}: {len(people)} people, {', '.join(filter(None, found))}"


def _mean(values: Iterable[float | None], name: str) -> str:
    """Return mean and standard deviation of what is known; "" of too few."""
    known = [value for value in values if value is not None]
    if len(known) < MIN_PARTICIPANTS:
        return ""
    return f"{name} {mean(known):.3g} (SD {stdev(known):.2g}, {len(known)} people)"


def _shares(values: Iterable[str], name: str) -> str:
    """Return how many have each value; "" where none is known."""
    counts = Counter(value or "unknown" for value in values)
    told = " and ".join(f"{counts[value]} {value}" for value in sorted(counts))
    return "" if set(counts) == {"unknown"} else f"{name}: {told}"


def _estimates(results: Results, slug: str) -> str:
    """Return an outcome's numbers, means and differences, with 95 % intervals."""
    found, outcome = results.find(slug), results.study.outcomes[slug]
    label, unit = outcome.name, outcome.scale
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
