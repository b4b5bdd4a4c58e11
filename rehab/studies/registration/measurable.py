"""Outcomes that a plan cannot give, or that its arms could not be compared by: not registered."""

from __future__ import annotations

from collections.abc import Iterator

from django.utils.translation import gettext

from rehab.studies.analysis.clinical_outcomes import FOLLOW_UP
from rehab.studies.analysis.outcomes import OF_QUESTIONS, Outcome
from rehab.studies.models import Study
from rehab.training.phases import PHASE_KINDS
from rehab.training.valences import find_valence

# The kind of phase without which an outcome has no strides.
PHASES = {
    "catch_change": "catch",
    "washout_change": "washout",
    "washout_loss": "washout",
    "after_effect": "washout",
}
SCORES = {"score", "points_per_100_steps"}
# Between visits; the change of the baseline also by a follow-up.
SEVERAL_VISITS = {"baseline_change", "between_visits", "savings"}
# Of strides with feedback, in the measure's unit or in percent of its values.
OF_TRAINING = {
    *("training_change", "early_change", "late_change", "washout_loss", "between_visits"),
    *("percent_of_goal", "absolute_error", "variation", "steadiness", "lag_1"),
    *("mean_performance", "improvement_over_baseline"),
}
OF_MEASURE = {*OF_TRAINING, *PHASES, "baseline_change", "follow_up_change"}
WITH_FEEDBACK = {
    *(*OF_TRAINING, *SCORES, "strides_to_success", "savings"),
    *("hit_rate", "best_streak", "steps"),
}


def needs_follow_up(outcome: Outcome) -> bool:
    """Return whether an outcome is found at the follow-up alone."""
    return outcome.slug == "follow_up_change" or outcome.window == FOLLOW_UP


def find_unmeasurable(study: Study, slug: str) -> Iterator[str]:
    """Yield why a study could not find an outcome, each with its cure. Raises InvalidSetting."""
    label = study.outcome_label(slug)
    for why in _reasons(study, slug):
        yield gettext("“%(outcome)s” %(why)s") % {"outcome": label, "why": why}


def _reasons(study: Study, slug: str) -> Iterator[str]:
    """Yield why a study could not find an outcome, and what to do."""
    arms = list(study.arms.select_related("measure", "protocol"))
    if slug not in study.outcomes:
        yield gettext("is not there any more: choose another outcome.")
        return
    if needs_follow_up(study.outcomes[slug]) and study.follow_up_days is None:
        yield gettext(
            "needs a follow-up, and none is planned: give the days to it, or choose another "
            "outcome."
        )
    visits = study.visits * (len(arms) if study.crossover else 1)
    visits += slug == "baseline_change" and study.follow_up_days is not None
    if slug in SEVERAL_VISITS and visits < 2:
        yield gettext("needs two visits: plan more of them, or choose another outcome.")
    without = [a.code for a in arms if a.protocol and slug not in a.protocol.questionnaires]
    if slug in OF_QUESTIONS and without:
        yield gettext(
            "is asked after sessions, and the protocol of arm %(arms)s does not ask it: choose it "
            "there (Admin › Protocols), or another outcome."
        ) % {"arms": ", ".join(without)}
    phases = {arm.code: arm.phases() for arm in arms}
    kind = PHASES.get(slug, "")
    without = [code for code, of in phases.items() if all(one.kind != kind for one in of)]
    if kind and without:
        yield gettext(
            "needs a phase “%(kind)s”, and the protocol of arm %(arms)s has none: choose another "
            "protocol or outcome."
        ) % {"kind": gettext(PHASE_KINDS[kind].label), "arms": ", ".join(without)}
    without = [code for code, of in phases.items() if not any(one.feedback for one in of)]
    if slug in WITH_FEEDBACK and without:
        yield gettext(
            "is of strides with feedback, and the protocol of arm %(arms)s gives none: choose "
            "another protocol or outcome."
        ) % {"arms": ", ".join(without)}
    valences = [find_valence(arm.valence) for arm in arms]
    # Whether points exist, are won, are lost: what a clinic edits keeps that.
    rules = {(one.has_points, bool(one.hit_points), bool(one.miss_points)) for one in valences}
    if slug in SCORES and len(rules) > 1:
        yield gettext(
            "cannot be compared: under one arm's feedback a score rises, under another's it falls "
            "or does not exist. Choose an outcome that is measured, such as the change in training."
        )
    elif slug in SCORES and not all(one.has_points for one in valences):
        yield gettext("does not exist: the arms' feedback has no points. Choose another outcome.")
    if slug in OF_MEASURE and len({arm.measure_id for arm in arms}) > 1:
        yield gettext(
            "cannot be compared between different measures: choose the same measure for all arms, "
            "or another outcome."
        )
