"""Outcomes that a study may register.

The list is that of the literature on feedback of push-off (docs/reference/gait.md#outcomes), as far
as strides show it; what further channels are sent (forces, moments, step lengths) is compared with
the baseline under the channel's name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rehab.studies.analysis import walk_figures as figures
from rehab.studies.analysis.clinical_outcomes import CLINICAL_OUTCOMES
from rehab.studies.analysis.walk_figures import ENDS, FIRST_AFTER, SUCCESS, WINDOW, History
from rehab.studies.analysis.walks import Walk
from rehab.training.summary.metrics import METRICS
from robot.marking import gettext_noop


@dataclass(frozen=True, slots=True)
class Outcome:
    """A figure that a study may register.

    Attributes
    ----------
    slug, label, unit
        For programs, for people (translated by pages), and of the figure; "" for ratios.
    meaning
        How it is computed, as the registered document and the codebook define it.
    compute
        Returns it of a session with what came before; None where there is none.
    """

    slug: str
    label: str
    unit: str
    meaning: str
    compute: Callable[[Walk, History], float | None]


OWN, FIRST = "this visit's own baseline", "in percent of the first visit's baseline"
# What the strides themselves show; with what every session stores of itself, all of `OUTCOMES`.
OF_STRIDES: dict[str, Outcome] = {
    outcome.slug: outcome
    for outcome in (
        Outcome(
            "training_change",
            gettext_noop("Change in training"),
            "%",
            f"Mean of all valid strides with feedback less the baseline, {FIRST}.",
            figures.training,
        ),
        Outcome(
            "early_change",
            gettext_noop("Early change (first 50 strides)"),
            "%",
            f"Mean of the first {ENDS} valid strides with feedback less the baseline, {FIRST}.",
            figures.early,
        ),
        Outcome(
            "late_change",
            gettext_noop("Late change (last 50 strides)"),
            "%",
            f"Mean of the last {ENDS} valid strides with feedback less the baseline, {FIRST}.",
            figures.late,
        ),
        Outcome(
            "catch_change",
            gettext_noop("Change in catch blocks"),
            "%",
            f"Mean of the valid strides of catch phases less the baseline, {FIRST}.",
            figures.catch,
        ),
        Outcome(
            "washout_change",
            gettext_noop("Change in washout"),
            "%",
            f"Mean of the valid strides of washout phases less the baseline, {FIRST}.",
            figures.washout,
        ),
        Outcome(
            "washout_loss",
            gettext_noop("From late training to washout"),
            "%",
            f"Change in washout less late change, {FIRST}; negative where some was lost.",
            figures.washout_loss,
        ),
        Outcome(
            "after_effect",
            gettext_noop("After-effect (first 20 strides)"),
            "%",
            f"Mean of the first {FIRST_AFTER} valid strides of washout less the baseline, {FIRST}.",
            figures.after_effect,
        ),
        Outcome(
            "baseline_change",
            gettext_noop("Change of the baseline since the first visit"),
            "%",
            f"Mean of this visit's baseline less the first one, {FIRST}; none at the first visit.",
            figures.carried,
        ),
        Outcome(
            "follow_up_change",
            gettext_noop("Change at the follow-up"),
            "%",
            f"Mean of all valid strides of the follow-up less the baseline, {FIRST}.",
            figures.follow_up,
        ),
        Outcome(
            "between_visits",
            gettext_noop("Early training of this visit less late training of the visit before"),
            "%",
            f"Early change less the late change of the visit before, both with feedback, {FIRST}.",
            figures.visit_loss,
        ),
        Outcome(
            "strides_to_success",
            gettext_noop("Strides until 80 % are hits"),
            "steps",
            f"Judged strides until {WINDOW} in a row had {SUCCESS:.0%} hits; all where none had.",
            figures.to_success,
        ),
        Outcome(
            "savings",
            gettext_noop("Strides saved since the last visit"),
            "steps",
            "Strides until 80 % are hits at the visit before, less those at this one.",
            figures.savings,
        ),
        Outcome(
            "percent_of_goal",
            gettext_noop("Real value of the goal"),
            "%",
            "Mean of value / goal of the judged strides, whatever the display's gain.",
            figures.of_goal,
        ),
        Outcome(
            "absolute_error",
            gettext_noop("Distance from the goal"),
            "%",
            "Mean of |shown / goal - 1| of the judged strides.",
            figures.error,
        ),
        Outcome(
            "variation",
            gettext_noop("Variation (CV)"),
            "%",
            "Sample standard deviation of the strides with feedback, in percent of their mean.",
            figures.cv,
        ),
        Outcome(
            "steadiness",
            gettext_noop("Variation about the trend"),
            "%",
            "Standard deviation of the strides with feedback about their straight line, in percent "
            f"of {OWN}.",
            figures.steadiness,
        ),
        Outcome(
            "lag_1",
            gettext_noop("Memory from stride to stride (lag 1)"),
            "",
            "Lag-1 autocorrelation of the strides with feedback.",
            figures.lag_1,
        ),
        Outcome(
            "invalid_strides",
            gettext_noop("Invalid strides"),
            "%",
            "Share of the trained leg's strides that are not valid.",
            figures.invalid,
        ),
    )
}
# Of the session's metrics: what counts days or sessions compares nothing, and a share of what was
# gained exists only for those who gained.
NOT_COMPARED = {"retention_in_washout"}
OF_SESSIONS = {
    metric.slug: metric
    for metric in METRICS.values()
    if metric.unit not in {"days", "sessions"} and metric.slug not in NOT_COMPARED
}
# Scores of questionnaires that a protocol asks after its sessions, stored like a session's figures.
OF_QUESTIONS = {
    "sus": (gettext_noop("System usability (SUS)"), "points"),
    "tlx": (gettext_noop("Workload (NASA-TLX)"), "points"),
}
# How each outcome is computed; of sessions, with the visit's own baseline.
MEANINGS = {
    "score": "Points of the session; none where the feedback type has no points.",
    "hit_rate": "Hits / judged strides with feedback.",
    "mean_performance": "Mean of shown / goal of the judged strides with feedback.",
    "best_streak": "Most hits in a row.",
    "points_per_100_steps": "100 x score / judged strides.",
    "improvement_over_baseline": "Mean of the valid strides with feedback less the mean of the "
    f"baseline, in percent of {OWN}.",
    "steps": "Judged strides with feedback.",
    "active_minutes": "Time that was walked.",
    "sus": "System Usability Scale after the session, 0 to 100; none where an item was skipped; "
    "higher is better.",
    "tlx": "Raw NASA-TLX after the session, 0 to 100; none where a scale was skipped; lower is "
    "better.",
} | {slug: one.meaning for slug, one in (OF_STRIDES | CLINICAL_OUTCOMES).items()}
LOWER_IS_BETTER = frozenset(
    {"strides_to_success", "absolute_error", "variation", "steadiness", "invalid_strides", "tlx"}
    | {slug for slug, one in CLINICAL_OUTCOMES.items() if not one.test.higher_is_better}
)
BOUNDS = {"hit_rate": (0.0, 1.0), "invalid_strides": (0.0, 100.0)}  # where intervals are cut
# Slug to label and unit of all that may be registered.
OUTCOMES: dict[str, tuple[str, str]] = {
    **{slug: (one.label, one.unit) for slug, one in (OF_SESSIONS | OF_STRIDES).items()},
    **OF_QUESTIONS,
    **{slug: (one.label, one.unit) for slug, one in CLINICAL_OUTCOMES.items()},
}


def define_outcomes() -> list[dict[str, str]]:
    """Return name, unit and meaning of every outcome that may be registered."""
    return [
        {"outcome": slug, "label": label, "unit": unit, "meaning": MEANINGS[slug]}
        for slug, (label, unit) in OUTCOMES.items()
    ]


def scale_of(slug: str) -> str:
    """Return the unit of an outcome or a further channel with what it is a percentage of."""
    if slug not in OUTCOMES:
        return f"% of {OWN}"
    meaning = MEANINGS[slug]
    of = (OWN in meaning and OWN) or (FIRST in meaning and FIRST.removeprefix("in percent of "))
    return f"% of {of}" if of else OUTCOMES[slug][1]


def compute_outcomes(walk: Walk, history: History, metrics: dict[str, float]) -> dict[str, float]:
    """Return every outcome that a session has, by slug.

    Parameters
    ----------
    walk, history
        The session, and what came before it.
    metrics
        The figures that the session stores, by slug, in the units of `METRICS`.
    """
    figures = {slug: value for slug, value in metrics.items() if slug in OUTCOMES}
    for slug, outcome in OF_STRIDES.items():
        value = outcome.compute(walk, history)
        if value is not None:
            figures[slug] = value
    return figures
