"""A study's results as figures and files, in the reader's language."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable
from typing import Any

from django.utils.translation import gettext, ngettext

from rehab.people.web.csv_tables import CsvWriter
from rehab.studies.analysis.participants import CHANNEL, by_arm
from rehab.studies.figures.flow import Box, draw_flow
from rehab.studies.figures.forest import ForestRow, draw_forest
from rehab.studies.figures.learning import CurveLabels, PhaseLabel, draw_curves
from rehab.studies.figures.people import draw_people
from rehab.studies.guesses import guess_rows
from rehab.studies.models import Study
from rehab.studies.results.results import Results
from rehab.studies.results.tables import (
    carry_over_rows,
    change_rows,
    conduct_rows,
    curve_rows,
    difference_rows,
    flow_rows,
    look_rows,
    occurrence_rows,
    outcome_rows,
    phase_rows,
    screening_rows,
)

LONG = 18  # letters of a name of which two fit on a line


def outcome_label(study: Study, slug: str) -> str:
    """Return an outcome's name, translated; a further channel's is its own."""
    if slug.startswith(CHANNEL):
        return slug.removeprefix(CHANNEL)
    return study.outcome_label(slug)


def outcome_unit(study: Study, slug: str) -> str:
    """Return an outcome's unit, translated; "" for ratios."""
    unit = "%" if slug.startswith(CHANNEL) else study.outcomes[slug].unit
    return gettext(unit) if unit else ""


def draw_learning(results: Results) -> str:
    """Return the curves of learning and retention."""
    words = CurveLabels(
        gettext("Learning and retention, with 95 % bands"),
        gettext("% of baseline"),
        gettext("blocks of 10 strides"),
        gettext("Visit {number}"),
    )
    return draw_curves(results.curves, results.arms, _phases(results), words)


def _phases(results: Results) -> list[PhaseLabel]:
    """Return the phases by their index, as the first participant with them walked them."""
    found: dict[int, PhaseLabel] = {}
    for one in results.participants:
        for visit in one.visits:
            for phase in visit.phases:
                label = PhaseLabel(gettext(phase["name"]), phase["feedback"])
                found.setdefault(phase["phase"], label)
    return [found.get(index, PhaseLabel("", True)) for index in range(max(found, default=-1) + 1)]


def draw_primary(results: Results) -> str:
    """Return every participant's primary outcome, by arm."""
    slug = results.primary
    study = results.study
    label, unit = outcome_label(study, slug), outcome_unit(study, slug)
    values = by_arm(results.participants, list(results.arms), slug)
    axis = f"{label} ({unit})" if unit else label
    crossed = results.study.crossover
    return draw_people(results.find(slug), values, results.arms, label, axis, joined=crossed)


def draw_registered(results: Results) -> str:
    """Return the effect sizes of the registered outcomes."""
    return _forest(results, results.registered, gettext("Registered outcomes"))


def draw_exploratory(results: Results) -> str:
    """Return the effect sizes of all other outcomes."""
    return _forest(results, results.exploratory, gettext("Exploratory outcomes"))


def _forest(results: Results, slugs: Iterable[str], title: str) -> str:
    rows = []
    for slug in slugs:
        label, registered = outcome_label(results.study, slug), results.registered.get(slug)
        status = registered.status_text if registered else ""
        rows.append(ForestRow(f"{label} ({status})" if status else label))
        is_first = slug == results.primary
        rows += [
            ForestRow(name_pair(results, one.group, one.reference), one, strong=is_first)
            for one in results.find(slug).differences
        ]
    return draw_forest(
        rows, title, gettext("Hedges’ g with intervals of 95 %, not adjusted for multiplicity")
    )


def name_pair(results: Results, group: str, reference: str) -> str:
    """Return two arms as a difference; by their codes where names are long."""
    names = [results.arms[arm] for arm in (group, reference)]
    if max(map(len, results.arms.values())) > LONG:
        names = [name.partition(":")[0] for name in names]
    return " − ".join(names)


def draw_consort(results: Results) -> str:
    """Return the flow of participants."""
    columns = []
    for one in results.flow:
        left = [gettext("%(count)d left the study") % {"count": one.left}] if one.left else []
        if one.visits_unfinished:
            early = one.visits_unfinished
            words = ngettext(
                "%(count)d session ended early", "%(count)d sessions ended early", early
            )
            left.append(words % {"count": early})
        if one.visits_excluded:
            excluded = one.visits_excluded
            words = ngettext("%(count)d session excluded", "%(count)d sessions excluded", excluded)
            left.append(words % {"count": excluded})
        before = [_n(gettext("never began"), one.never_began)] if one.never_began else []
        if one.removed:
            before.append(gettext("%(count)d had agreed to removal") % {"count": one.removed})
        visits = {"walked": one.visits_walked, "planned": one.visits_planned}
        columns.append(
            [
                Box(results.arms[one.arm], (_n(gettext("allocated"), one.allocated), *before)),
                Box(
                    _n(gettext("began"), one.began),
                    (
                        gettext("%(walked)d of %(planned)d visits walked") % visits,
                        _n(gettext("all visits"), one.completed),
                        *left,
                    ),
                ),
                Box(_n(gettext("analyzed"), one.analyzed)),
            ]
        )
    assessed = results.assessed
    away = [
        _n(gettext("not eligible"), assessed.not_eligible),
        _n(gettext("declined"), assessed.declined),
    ]
    lines = (
        *(away if assessed.turned_away else ()),
        _n(gettext("allocated"), len(results.participants)),
    )
    first = Box(_n(gettext("assessed for eligibility"), assessed.people), lines)
    return draw_flow(first, columns, gettext("Flow of participants"))


def _n(words: str, count: int) -> str:
    return f"{words}: n = {count}"


FIGURES: dict[str, Callable[[Results], str]] = {
    "learning": draw_learning,
    "primary": draw_primary,
    "registered": draw_registered,
    "exploratory": draw_exploratory,
    "flow": draw_consort,
}
TABLES: dict[str, Callable[[Results], Iterable[dict[str, Any]]]] = {
    "outcomes": outcome_rows,
    "phases": phase_rows,
    "differences": difference_rows,
    "carry_over": carry_over_rows,
    "curves": curve_rows,
    "flow": flow_rows,
    "looks": look_rows,
    "screening": screening_rows,
    "changes": change_rows,
    "conduct": conduct_rows,
    "occurrences": occurrence_rows,
    "guesses": lambda results: guess_rows(results.study),
}


# What is shown before the end: the rest shows single people, or what tells an arm.
INTERIM = frozenset(
    {"registered", "differences", "flow", "looks", "screening", "changes", "conduct"}
)


def is_shown(results: Results, name: str) -> bool:
    """Return whether a figure or table is shown now."""
    return not results.is_interim or name in INTERIM


def write_table(rows: Iterable[dict[str, Any]], header: Iterable[str] = ()) -> str:
    """Return rows as CSV with a heading; numbers with a point, what is missing empty.

    Parameters
    ----------
    rows, header
        All with the same keys; the heading where there is none.
    """
    text = io.StringIO()
    writer, is_first = CsvWriter(text), True
    for row in rows:
        writer.write([list(row), list(row.values())] if is_first else [list(row.values())])
        is_first = False
    if is_first and (columns := list(header)):
        writer.write([columns])
    return text.getvalue()
