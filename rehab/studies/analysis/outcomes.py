"""Outcomes that a study may register.

The list is that of the literature on feedback of push-off (docs/reference/gait.md#outcomes), as far
as strides show it; what further channels are sent (forces, moments, step lengths) is compared with
the baseline under the channel's name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from rehab.questionnaires.standard_tests import CLINICAL_TESTS, ClinicalTest
from rehab.studies.analysis import walk_figures as figures
from rehab.studies.analysis.clinical_outcomes import SLUGS, meaning_of, slug_of
from rehab.studies.analysis.walk_figures import ENDS, FIRST_AFTER, SUCCESS, WINDOW, History
from rehab.studies.analysis.walks import Walk
from rehab.training.summary.metrics import METRICS
from robot.marking import gettext_noop

OWN, FIRST = "this visit's own baseline", "in percent of the first visit's baseline"


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
        Of strides: returns it of a session with what came before it; None where there is none.
    window
        Of a clinical test, whose ``label`` it has: ``AFTER`` or ``FOLLOW_UP``.
    higher_is_better
        Whether a higher figure is the better one.
    """

    slug: str
    label: str
    unit: str
    meaning: str
    compute: Callable[[Walk, History], float | None] | None = None
    window: str = ""
    higher_is_better: bool = True

    @property
    def name(self) -> str:
        """What people call it, in English."""
        return f"{self.label}, {self.window}" if self.window else self.label

    @property
    def scale(self) -> str:
        """Its unit with what it is a percentage of."""
        of = next((one for one in (OWN, FIRST) if one in self.meaning), "")
        return f"% of {of.removeprefix('in percent of ')}" if of else self.unit

    def to_row(self) -> dict[str, str]:
        """Return it as a codebook has it."""
        better = "higher" if self.higher_is_better else "lower"
        row = {"outcome": self.slug, "label": self.name, "unit": self.unit}
        return row | {"better": better, "meaning": self.meaning}


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
            higher_is_better=False,
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
            higher_is_better=False,
        ),
        Outcome(
            "variation",
            gettext_noop("Variation (CV)"),
            "%",
            "Sample standard deviation of the strides with feedback, in percent of their mean.",
            figures.cv,
            higher_is_better=False,
        ),
        Outcome(
            "steadiness",
            gettext_noop("Variation about the trend"),
            "%",
            "Standard deviation of the strides with feedback about their straight line, in percent "
            f"of {OWN}.",
            figures.steadiness,
            higher_is_better=False,
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
            higher_is_better=False,
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
# How those that are not of strides are computed, with the visit's own baseline.
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
}
BOUNDS = {"hit_rate": (0.0, 1.0), "invalid_strides": (0.0, 100.0)}  # where intervals are cut


def outcomes_with(tests: Iterable[ClinicalTest]) -> dict[str, Outcome]:
    """Return all that may be registered, by slug. ``tests``: of the clinic's own."""
    found = (*_of_walks(), *_of_tests([*CLINICAL_TESTS.values(), *tests]))
    return {one.slug: one for one in found}


def _of_walks() -> Iterator[Outcome]:
    figures = {slug: (one.label, one.unit) for slug, one in OF_SESSIONS.items()} | OF_QUESTIONS
    for slug, (label, unit) in figures.items():
        yield Outcome(slug, label, unit, MEANINGS[slug], higher_is_better=slug != "tlx")
    yield from OF_STRIDES.values()


def _of_tests(tests: Iterable[ClinicalTest]) -> Iterator[Outcome]:
    for test in tests:
        for window in SLUGS:
            yield Outcome(
                slug_of(test.slug, window),
                test.label,
                test.unit or "points",
                meaning_of(test, window),
                window=window,
                higher_is_better=test.higher_is_better,
            )


OUTCOMES = outcomes_with(())  # what every clinic has


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
        value = outcome.compute and outcome.compute(walk, history)
        if value is not None:
            figures[slug] = value
    return figures
