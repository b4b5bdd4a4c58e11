"""Power by simulation: the request, and what the studies simulated so far found."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any, ClassVar

from django.db import models
from django.utils import timezone
from django.utils.formats import number_format
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.models import User
from rehab.people.scope import Scope, ScopedModel
from rehab.studies.analysis.clinical_outcomes import is_of_test
from rehab.studies.analysis.outcomes import OF_QUESTIONS
from rehab.studies.models import Study
from rehab.studies.simulation.power import PairPower, SimulatedDifference, simulate_from, summarize
from rehab.studies.simulation.trial import Trial, walkable
from rehab.studies.simulation.walkers import Population
from rehab.training.goals import GoalRule
from rehab.training.measures import A2, InvalidSetting
from rehab.training.plans import SessionPlan
from rehab.training.steps import Side
from rehab.training.valences import find_valence

SIMULATIONS, SIMULATIONS_MAX = 100, 5000
STORED_EVERY_S = 3.0  # so much work is lost at most
STALLED_AFTER = timedelta(seconds=60)  # without a write to the run


class PowerRun(ScopedModel):
    """Studies simulated from seeds 0, 1, 2 …, each once: a continued run begins where it stopped.

    ``settings``: what `build_trial` reads. ``found``: by seed, what each comparison of arms found.
    """

    scope = Scope(clinic="study__clinic")

    study = models.ForeignKey(Study, on_delete=models.CASCADE, related_name="power_runs")
    by = models.ForeignKey(User, on_delete=models.SET_NULL, related_name="+", null=True)
    at = models.DateTimeField(default=timezone.now)
    settings = models.JSONField()
    simulations = models.PositiveIntegerField(_("simulated studies"))
    found = models.JSONField(default=dict)
    worked_at = models.DateTimeField(null=True)
    trouble = models.TextField(blank=True)

    class Meta(ScopedModel.Meta):
        verbose_name = _("power simulation")
        ordering: ClassVar = ["-pk"]

    def __str__(self) -> str:
        return f"{self.study.code}: {self.simulations}"

    @property
    def done(self) -> int:
        """How many studies are simulated."""
        return len(self.found)

    @property
    def assumptions(self) -> str:
        """From which seeds it simulates, and what it assumes, in words."""
        names = ("sd_percent", "kept_percent", "dropout_percent")
        numbers = {name: f"{self.settings[name]:g}" for name in names}
        seeds = gettext(
            "Seeds 0 to %(last)d; people differ by %(sd_percent)s %%, washout keeps "
            "%(kept_percent)s %%, %(dropout_percent)s %% leave before each visit. Pairs are not "
            "corrected for their number."
        )
        told = seeds % (numbers | {"last": self.simulations - 1})
        spreads = [one.sd for one in self.power if one.sd is not None]
        if spreads and self.study.planned_sd:
            had = gettext("In the outcome they differed by an SD of %(had)s; planned were %(sd)s.")
            shown = {"had": max(spreads), "sd": self.study.planned_sd}
            told += " " + had % {n: number_format(f"{sd:.3g}") for n, sd in shown.items()}
        return told

    @property
    def is_done(self) -> bool:
        """Whether all are."""
        return self.done >= self.simulations

    def is_working(self, now: datetime) -> bool:
        """Return whether a process simulates for it now."""
        if self.is_done or self.trouble or self.worked_at is None:
            return False
        return now - self.worked_at < STALLED_AFTER

    @property
    def power(self) -> list[PairPower]:
        """What the simulated studies found, for each pair of arms."""
        return summarize(
            [SimulatedDifference(*row) for rows in self.found.values() for row in rows],
            self.study.margin,
            higher_is_better=self.study.outcomes[self.study.primary_outcome].higher_is_better,
        )


# Outcomes in percent of the baseline that an arm changes by what it adds to training, or by what is
# kept of that without feedback.
OF_TRAINING = {"training_change", "early_change", "late_change", "improvement_over_baseline"}
KEPT = {"catch_change", "washout_change", "after_effect"}


def usual_settings(study: Study) -> dict[str, Any]:
    """Return what a new run assumes: what the latest one did, else what the plan says.

    A difference and an SD of an outcome without feedback are more than that in training, of which a
    part is kept. Of other outcomes the plan's figures tell nothing of training.
    """
    if (last := study.power_runs.first()) is not None:
        return dict(last.settings) | {"simulations": last.simulations}
    usual = Population()
    share = {**dict.fromkeys(OF_TRAINING, 1.0), **dict.fromkeys(KEPT, usual.retained)}
    of_outcome = share.get(study.primary_outcome)
    codes = list(study.arms.values_list("code", flat=True))
    found = study.assumed.get("difference") if of_outcome else None
    sd = study.planned_sd if of_outcome else None
    return {
        "participants": study.participants,
        "sd_percent": min(sd / of_outcome, 100.0) if sd and of_outcome else usual.sd_percent,
        "kept_percent": 100 * usual.retained,
        "dropout_percent": 100 * study.assumed.get("dropout", 0.0) / _visits_of(study),
        "effects": {codes[-1]: found / of_outcome} if found and of_outcome and codes else {},
        "simulations": SIMULATIONS,
    }


def _visits_of(study: Study) -> int:
    """Return how many visits a participant may leave before."""
    return study.visits * (study.arms.count() if study.crossover else 1)


def build_trial(study: Study, settings: dict[str, Any]) -> Trial:
    """Return a study as it is simulated.

    All arms walk the first one's phases, so that the effects that were typed in are the whole
    difference between them. Simulated people train A2, in units of their baseline.

    Parameters
    ----------
    study
        The study, with arms.
    settings
        ``effects`` by the arm's code [% of the baseline], ``participants``, ``sd_percent``,
        ``kept_percent`` and ``dropout_percent``, as ``PowerForm.to_settings`` returns them.

    Raises
    ------
    InvalidSetting
        For a study without an effect, or one that cannot be simulated.
    """
    if is_of_test(study.primary_outcome) or study.primary_outcome in OF_QUESTIONS:
        raise InvalidSetting(
            gettext(
                "Simulated people take no clinical tests and answer no questions. Choose a primary "
                "outcome of the strides to simulate; plan this one by its SD between people."
            )
        )
    arms = list(study.arms.select_related("protocol", "measure"))
    groups = study.groups()
    plan = walkable(
        SessionPlan(
            measure=A2,
            valence=find_valence(arms[0].valence),
            phases=arms[0].phases(),
            trained_side=Side.LEFT,
            goal=GoalRule(percent_of_baseline=study.goal_percent),
        )
    )
    effects = {arm.code: float(settings["effects"].get(arm.code, 0.0)) for arm in arms}
    if not any(effects.values()) and study.margin is None:
        raise InvalidSetting(gettext("Give an arm an effect: power is the chance to find it."))
    return Trial(
        plans={arm.code: plan for arm in arms},
        effects=effects,
        groups=groups,
        participants=settings["participants"],
        outcome=study.primary_outcome,
        visits=study.visits,
        population=Population(
            settings["sd_percent"],
            settings["kept_percent"] / 100,
            settings["dropout_percent"] / 100,
        ),
    )


def plan_run(
    study: Study, settings: dict[str, Any], simulations: int, by: User | None, now: datetime
) -> PowerRun:
    """Store a run of simulated studies; `work` carries it out.

    Parameters
    ----------
    study, settings
        As for `build_trial`.
    simulations
        How many studies, 1 to ``SIMULATIONS_MAX``.
    by, now
        Who asks for it, and when.

    Raises
    ------
    InvalidSetting
        For too few or too many, and for a study that cannot be simulated.
    """
    if not 1 <= simulations <= SIMULATIONS_MAX:
        raise InvalidSetting("Simulate 1 to {most} studies.", most=SIMULATIONS_MAX)
    build_trial(study, settings)
    return PowerRun.everywhere.create(
        study=study, settings=settings, simulations=simulations, by=by, at=now
    )


def work(run: PowerRun) -> Iterator[PowerRun]:
    """Simulate what a run still lacks, and yield it each time something is stored.

    Raises InvalidSetting, and notes it, where the study cannot be simulated any more.
    """
    try:
        trial = build_trial(run.study, run.settings)
    except InvalidSetting as problem:
        run.trouble = str(problem)
        run.save(update_fields=["trouble"])
        raise
    missing = [seed for seed in range(run.simulations) if str(seed) not in run.found]
    _store(run)
    for seeds in simulate_from(trial, missing, STORED_EVERY_S):
        run.found |= {str(seed): [list(one) for one in rows] for seed, rows in seeds.items()}
        _store(run)
        yield run


def _store(run: PowerRun) -> None:
    run.worked_at = timezone.now()
    run.save(update_fields=["found", "worked_at"])
