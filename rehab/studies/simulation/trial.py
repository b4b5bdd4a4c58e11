"""A simulated study by the pure fold: no database, the same figures as by the real path."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from operator import attrgetter

from rehab.sources.synthetic import SyntheticWalker
from rehab.studies.allocation.crossover import VisitPlan
from rehab.studies.allocation.groups_and_strata import Allocated, Group
from rehab.studies.allocation.scheme import Method, Scheme, Secret
from rehab.studies.analysis.comparison import Difference, compare
from rehab.studies.analysis.findings import observations
from rehab.studies.analysis.participants import (
    AnalyzedSession,
    Participant,
    ParticipantVisit,
    make_participant,
)
from rehab.studies.analysis.walks import COLUMNS, read_walk
from rehab.studies.simulation.walkers import ENDLESS, Person, Population, draw_person, walk_through
from rehab.training.changes import Change, ChangeKind
from rehab.training.fold import SessionFold
from rehab.training.measures import InvalidSetting
from rehab.training.plans import SessionPlan
from rehab.training.summary.metrics import compute_metrics

PARTICIPANTS_MAX = 2000
EFFECT_MAX = 100.0
A_DAY = date(2026, 1, 1)  # days do not matter to simulated people
of_columns = attrgetter(*COLUMNS)


@dataclass(frozen=True, slots=True)
class Trial:
    """A study to simulate.

    Attributes
    ----------
    plans
        The plan of each arm's sessions, by the arm's code.
    effects
        What each arm truly adds to training [% of the baseline].
    groups
        What is allocated: an arm, or arms in an order.
    participants, visits
        How many people, and visits of each in each period.
    outcome
        Slug of the primary outcome.
    population
        How people differ.
    block_sizes
        Of the permuted blocks.

    Raises
    ------
    InvalidSetting
        For what could not be simulated.
    """

    plans: Mapping[str, SessionPlan]
    effects: Mapping[str, float]
    groups: tuple[Group, ...]
    participants: int
    outcome: str
    visits: int = 1
    population: Population = field(default_factory=Population)
    block_sizes: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if not 2 <= self.participants <= PARTICIPANTS_MAX:
            raise InvalidSetting("Simulate 2 to {most} participants.", most=PARTICIPANTS_MAX)
        if any(abs(effect) > EFFECT_MAX for effect in self.effects.values()):
            raise InvalidSetting("An arm adds at most 100 % of the baseline.")
        VisitPlan(self.visits)
        for plan in self.plans.values():
            if any(phase.strides is None and phase.seconds is None for phase in plan.phases):
                raise InvalidSetting(ENDLESS)
        self.scheme.check_secret(self.secret(0))

    @property
    def is_crossover(self) -> bool:
        """Whether everybody walks every arm."""
        return len(self.groups[0].arms) > 1

    @property
    def scheme(self) -> Scheme:
        """How participants are allocated."""
        return Scheme(self.groups, Method.BLOCKS)

    def secret(self, seed: int) -> Secret:
        """Return the secret by which a seed's participants are allocated."""
        share = sum(group.weight for group in self.groups)
        return Secret(f"simulated {seed:012}", self.block_sizes or (share,))

    def allocate(self, seed: int) -> Iterator[tuple[Person, str]]:
        """Yield the participants with their groups."""
        scheme, secret = self.scheme, self.secret(seed)
        earlier: list[Allocated] = []
        periods = len(self.groups[0].arms)
        for number in range(1, self.participants + 1):
            group = scheme.allocate(secret, earlier, ())
            earlier.append(Allocated((), group))
            yield draw_person(seed, number, self.population, periods * self.visits), group


def walkable(plan: SessionPlan) -> SessionPlan:
    """Return a plan without rests, which simulated people do not need."""
    return replace(plan, phases=tuple(replace(phase, rest_s=None) for phase in plan.phases))


def walk_by_fold(plan: SessionPlan, walker: SyntheticWalker) -> AnalyzedSession:
    """Return one session, scored by the rules alone.

    Parameters
    ----------
    plan
        What it is scored with.
    walker
        Who walks it; the strides depend on phase and goal.
    """
    fold = SessionFold(plan)
    fold.change(Change(ChangeKind.START))
    steps = [fold.step(stride) for stride in walk_through(walker, fold)]
    fold.change(Change(ChangeKind.FINISH))
    rows = (of_columns(step) for step in steps if step.side is plan.trained_side)
    better = plan.measure.higher_is_better
    return AnalyzedSession(
        read_walk(plan.phases, rows, higher_is_better=better),
        compute_metrics(fold),
        plan.measure.slug,
    )


def simulate(trial: Trial, seed: int) -> list[Participant]:
    """Return the participants of ``trial`` with their sessions. A seed always gives the same."""
    visit_plan = VisitPlan(trial.visits)
    participants = []
    for number, (person, group) in enumerate(trial.allocate(seed), start=1):
        arms = group.split("-")
        planned: list[tuple[ParticipantVisit, AnalyzedSession | None]] = []
        for visit in visit_plan.plan(len(arms), A_DAY):
            arm = arms[visit.period]
            has_left = 0 < person.leaves_before <= visit.number
            walked = None
            if not has_left:
                retained = trial.population.retained
                walker = person.at_visit(visit.number, trial.effects[arm], retained)
                walked = walk_by_fold(trial.plans[arm], walker)
            planned.append((ParticipantVisit(visit.number, arm, period=visit.period), walked))
        participants.append(
            make_participant(f"{number:03}", planned, has_left=person.leaves_before > 0)
        )
    return participants


def differences(
    trial: Trial, participants: Sequence[Participant], slug: str = ""
) -> tuple[Difference, ...]:
    """Return the differences between all pairs of arms in an outcome.

    Parameters
    ----------
    trial
        The study.
    participants
        Those that ``simulate`` returned.
    slug
        The outcome's; empty for the primary one.
    """
    observed = observations(participants, slug or trial.outcome)
    return compare(observed, list(trial.plans), crossover=trial.is_crossover).differences
