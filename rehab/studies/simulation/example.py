"""The study that `manage.py simulatestudy` plans: four feedback types, whose effects are known."""

from __future__ import annotations

from rehab.studies.allocation.groups_and_strata import Group
from rehab.studies.simulation.trial import Trial
from rehab.studies.simulation.walkers import Population
from rehab.training.goals import GoalRule
from rehab.training.measures import A2
from rehab.training.phases import Phase, make_phase
from rehab.training.plans import SessionPlan
from rehab.training.steps import Side
from rehab.training.valences import find_valence

OUTCOME = "improvement_over_baseline"
SECONDARY = ("late_change", "washout_change", "hit_rate", "between_visits")
BLOCK_SIZES = (4, 8)
# Arm, feedback type, and what the arm truly adds [% of the baseline]. Simulated, not measured.
ARMS = (
    ("A", "positive", 0.0),
    ("B", "negative", 4.0),
    ("C", "binary", 8.0),
    ("D", "explicit", -4.0),
)
PHASES: tuple[Phase, ...] = (
    make_phase("baseline", strides=54),
    make_phase("training", strides=80),
    make_phase("catch", strides=12),
    make_phase("training", strides=80),
    make_phase("washout", strides=40),
)


def example_trial(
    participants: int = 60, visits: int = 1, population: Population | None = None
) -> Trial:
    """Return the study, allocated to four arms of equal weight.

    Parameters
    ----------
    participants, visits
        How many people, and visits of each.
    population
        How people differ; None for the usual ``Population``.

    Raises
    ------
    InvalidSetting
        For numbers out of bounds.
    """
    plans = {
        code: SessionPlan(
            measure=A2,
            valence=find_valence(valence),
            phases=PHASES,
            trained_side=Side.LEFT,
            goal=GoalRule(percent_of_baseline=100),
        )
        for code, valence, _effect in ARMS
    }
    return Trial(
        plans=plans,
        effects={code: effect for code, _valence, effect in ARMS},
        groups=tuple(Group((code,)) for code, _valence, _effect in ARMS),
        participants=participants,
        outcome=OUTCOME,
        visits=visits,
        population=population or Population(),
        block_sizes=BLOCK_SIZES,
    )
