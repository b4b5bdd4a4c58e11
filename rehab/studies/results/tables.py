"""A study's results as rows: what its files have, and `reanalyze.py` computes again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from rehab.studies.analysis.comparison import Difference
from rehab.studies.analysis.findings import OutcomeResult, has_departed, observations
from rehab.studies.analysis.outcomes import OWN
from rehab.studies.analysis.participants import ParticipantVisit
from rehab.studies.registration.outcome_changes import CHANGE_COLUMNS
from rehab.studies.results.results import Results

INTERVAL = "low_95", "high_95"
PAIR = "outcome", "group", "reference"
VISIT = "participant", "group", "visit", "attendance"
STATUS = "unit", "status", "since_version", "dropped_in_version"
# The columns of tables that may have no row; of outcomes and guesses those of every study.
HEADERS: dict[str, tuple[str, ...]] = {
    "outcomes": (*VISIT, "outcome", *STATUS, "value", "arm", "period", "baseline", "per_protocol"),
    "phases": (
        *(*VISIT, "phase", "kind", "name", "feedback", "strides", "valid", "judged", "hit_rate"),
        *("change_percent", "shown_percent_of_goal", "shown_quartile_1", "shown_median"),
        *("shown_quartile_3", "real_percent_of_goal", "cv_percent", "sd_about_trend_percent"),
        "lag_1",
    ),
    "differences": (
        *("outcome", *STATUS, "group", "reference", "participants", "participants_reference"),
        *("paired", "difference", *INTERVAL, "hedges_g", "g_low_95", "g_high_95", "p", "p_holm"),
        *("level", "not_inferior", "per_protocol_difference", "per_protocol_low_95"),
        *("per_protocol_high_95", "missing_visits", "missing_visits_reference", "tipping_point"),
    ),
    "carry_over": (*PAIR, "carry_over", *INTERVAL, "p"),
    "curves": (
        *("group", "visit", "phase", "block_of_10", "participants", "percent_of_baseline"),
        *INTERVAL,
    ),
    "looks": ("participants", "planned", "spending", "level"),
    "changes": CHANGE_COLUMNS,
    "occurrences": ("participant", "group", "visit", "kind", "what", "value"),
    "guesses": ("guesser", "group", "do_not_know", "index", "estimate", *INTERVAL),
    "adverse_events": (
        *("participant", "arm", "what", "grade", "serious", "relation", "expected"),
        *("known_on_day", "due_on_day", "authority_due_on_day", "reported_on_day"),
    ),
}


def _visits(results: Results) -> Iterator[tuple[ParticipantVisit, dict[str, Any]]]:
    """Yield the visits of those who are analyzed, each with the columns that say whose it is."""
    for one in results.participants:
        for visit in one.visits if one.is_analyzed else ():
            group = results.arms[visit.arm]
            place = {"participant": one.code, "group": group, "visit": visit.number}
            yield visit, place | {"attendance": visit.attendance.value}


def outcome_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each participant, visit and outcome: missing ones are empty."""
    people, slugs = results.participants, (*results.registered, *results.exploratory)
    observed = {
        slug: {(one.participant, one.visit): one for one in observations(people, slug)}
        for slug in slugs
    }
    for visit, whose in _visits(results):
        for slug in slugs:
            one = observed[slug].get((whose["participant"], visit.number))
            yield (
                whose
                | {"outcome": slug, **_status(results, slug)}
                | {
                    "value": visit.outcomes.get(slug),
                    "arm": visit.arm,
                    "period": visit.period,
                    "baseline": one and one.baseline,
                    **{
                        f"stratum_{n}": level
                        for n, level in enumerate(one.strata if one else (), 1)
                    },
                    "per_protocol": one is not None and not has_departed(one, results.departures),
                }
            )


def _status(results: Results, slug: str) -> dict[str, Any]:
    """Return an outcome's unit, as what it was registered, and in which versions."""
    one, outcome = results.registered.get(slug), results.study.outcomes.get(slug)
    return {
        "unit": outcome.scale if outcome else f"% of {OWN}",
        "status": "exploratory" if one is None else one.status,
        "since_version": one and one.since,
        "dropped_in_version": one and one.dropped_in,
    }


def phase_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each participant, visit and phase."""
    for visit, whose in _visits(results):
        yield from (whose | phase for phase in visit.phases)


def difference_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each outcome and pair of groups."""
    for slug in (*results.registered, *results.exploratory):
        outcome = results.find(slug)
        for found in outcome.differences:
            yield {
                "outcome": slug,
                **_status(results, slug),
                "group": results.arms[found.group],
                "reference": results.arms[found.reference],
                "participants": found.participants[0],
                "participants_reference": found.participants[1],
                "paired": found.paired,
                "difference": found.difference.estimate,
                "low_95": found.difference.low,
                "high_95": found.difference.high,
                "hedges_g": found.effect and found.effect.estimate,
                "g_low_95": found.effect and found.effect.low,
                "g_high_95": found.effect and found.effect.high,
                "p": found.p,
                "p_holm": results.adjusted_p.get((slug, found.group, found.reference)),
                "level": results.level if slug == results.primary else None,
                "not_inferior": results.is_not_inferior(slug, found),
                **_sensitivity(outcome, found),
                "tipping_point": results.tipping_point(slug, found),
            }


def _sensitivity(outcome: OutcomeResult, found: Difference) -> dict[str, Any]:
    """Return the columns per protocol, and of what missing visits could do."""
    followed, missing = outcome.of_protocol(found), found.missing
    return {
        "per_protocol_difference": followed and followed.difference.estimate,
        "per_protocol_low_95": followed and followed.difference.low,
        "per_protocol_high_95": followed and followed.difference.high,
        "missing_visits": missing and missing.visits[0],
        "missing_visits_reference": missing and missing.visits[1],
    }


def carry_over_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each registered outcome of a crossover and pair of groups."""
    for slug in results.registered:
        for found in results.find(slug).carry_over:
            yield {
                "outcome": slug,
                "group": results.arms[found.group],
                "reference": results.arms[found.reference],
                "carry_over": found.difference.estimate,
                "low_95": found.difference.low,
                "high_95": found.difference.high,
                "p": found.p,
            }


def curve_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each point of each group's curve, in percent of the baseline."""
    for arm, points in results.curves.items():
        for point in points:
            yield {
                "group": results.arms[arm],
                "visit": point.place.visit + 1,
                "phase": point.place.phase + 1,
                "block_of_10": point.place.bin + 1,
                "participants": point.participants,
                "percent_of_baseline": point.mean,
                "low_95": point.low,
                "high_95": point.high,
            }


def flow_rows(results: Results) -> Sequence[dict[str, Any]]:
    """Return one row for each group of the flow of participants."""
    rows = [asdict(one) | {"primary_outcome": results.primary} for one in results.flow]
    return [{"group": results.arms[row.pop("arm")]} | row for row in rows]


def look_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each number of participants at which results were looked at."""
    for participants, level in results.levels:
        yield {
            "participants": participants,
            "planned": results.study.participants,
            "spending": results.study.spending,
            "level": level,
        }


def screening_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each number of the screening log, and for each criterion not met."""
    assessed = results.assessed
    for name in ("people", "not_eligible", "declined"):
        yield {"what": name, "criterion": "", "people": getattr(assessed, name)}
    for criterion, people in assessed.reasons.most_common():
        yield {"what": "criterion not met", "criterion": criterion, "people": people}


def change_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each version that changed outcomes."""
    for one in results.changes:
        row = one.to_row()
        yield row | {name: " ".join(row[name]) for name in ("added", "removed")}


def conduct_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each group and kind of harm or deviation."""
    for row in results.conduct:
        for arm, (events, people) in row.counts.items():
            about = {"group": results.arms[arm], "kind": row.kind, "what": row.what}
            yield about | {"events": events, "participants": people}


def occurrence_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each harm and deviation."""
    for one in results.occurrences:
        place = {"participant": one.participant, "group": results.arms[one.arm]}
        yield place | {
            "visit": one.visit,
            "kind": one.kind,
            "what": one.what,
            "value": one.value,
        }
