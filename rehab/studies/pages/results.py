"""A study's results: figures and tables, for those who may see them."""

from __future__ import annotations

from typing import Any

from django.core.exceptions import PermissionDenied
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.utils.safestring import mark_safe
from django.views.decorators.http import require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.sessions.formatting import format_number
from rehab.studies.analysis.comparison import Difference, Interval
from rehab.studies.analysis.findings import OutcomeResult
from rehab.studies.guesses import GUESSERS, Guesser, group_labels, guess_rows
from rehab.studies.models import Study
from rehab.studies.pages.planning import get_study
from rehab.studies.results.drawing import (
    FIGURES,
    TABLES,
    is_shown,
    name_pair,
    outcome_label,
    outcome_unit,
    write_table,
)
from rehab.studies.results.results import Results, may_look, note_look, read_results
from rehab.studies.results.tables import HEADERS


def _open(request: HttpRequest, study_id: int) -> tuple[Study, User]:
    """Return a study whose results a user may see now. Raises PermissionDenied, Http404."""
    user = user_of(request)
    study = get_study(user, study_id)
    if not may_look(study, user):
        raise PermissionDenied
    return study, user


@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
@require_safe
def show_results(request: HttpRequest, study_id: int) -> HttpResponse:
    """Show what a study found. A look before its end is recorded."""
    study, user = _open(request, study_id)
    now = timezone.now()
    results = read_results(study, now)
    note_look(results, user, now)
    context = {
        "study": study,
        "interim": results.is_interim,
        "changes": results.changes,
        "level": results.level,
        "information": results.information,
        "blinded_size": results.blinded_size,
        "carry_over": [
            {
                "outcome": outcome_label(results.study, slug),
                "label": name_pair(results, one.group, one.reference),
                "difference": _format_interval(one.difference, outcome_unit(results.study, slug)),
                "p": _format_p(one.p),
            }
            for slug in results.registered
            for one in results.find(slug).carry_over
        ],
        "arms": results.arms.values(),
        "conduct": results.conduct,
        "figures": {
            name: _inline(draw(results))
            for name, draw in FIGURES.items()
            if is_shown(results, name)
        },
        "registered": [describe_outcome(results, slug) for slug in results.registered],
        "exploratory": [describe_outcome(results, slug) for slug in results.exploratory],
        "groups": group_labels(study),
        "guesses": []
        if results.is_interim
        else [_describe_guess(study, row) for row in guess_rows(study)],
        "tables": [name for name in TABLES if is_shown(results, name)],
    }
    return render(request, "studies/results.html", context)


def _inline(svg: str) -> str:
    return mark_safe(svg)  # noqa: S308 (drawn by `figures`, which escapes every text)


def describe_outcome(results: Results, slug: str) -> dict[str, Any]:
    """Return an outcome as the page's table has it."""
    found, unit = results.find(slug), outcome_unit(results.study, slug)
    registered = results.registered.get(slug)
    return {
        "label": outcome_label(results.study, slug),
        "unit": unit,
        "status": registered.status_text if registered else "",
        "arms": [
            {
                "label": results.arms[one.arm],
                "count": one.participants,
                "missing": one.missing,
                "mean": _format_interval(one.mean, unit),
            }
            for one in found.arms
        ],
        "differences": [
            {
                "label": name_pair(results, one.group, one.reference),
                "paired": one.paired,
                "difference": _format_interval(one.difference, unit),
                "effect": _format_interval(one.effect, ""),
                "p": _format_p(one.p),
                "p_holm": _format_p(
                    adjusted := results.adjusted_p.get((slug, one.group, one.reference))
                ),
                "is_found": bool(adjusted is not None and adjusted < (results.level or 0)),
                "per_protocol": _of_protocol(found, one, unit),
                "missing": one.missing and sum(one.missing.visits),
                "tipping_point": _tipping_point(results.tipping_point(slug, one), unit),
                "not_inferior": results.is_not_inferior(slug, one),
            }
            for one in found.differences
        ],
    }


def _describe_guess(study: Study, row: dict[str, Any]) -> dict[str, Any]:
    """Return a row of guesses as the page's table has it."""
    estimate = row["estimate"]
    interval = None if estimate is None else Interval(estimate, row["low_95"], row["high_95"])
    return {
        "guesser": GUESSERS[Guesser(row["guesser"])],
        "group": group_labels(study).get(row["group"], ""),
        "counts": [row[name] for name in row if name.startswith("guessed_")],
        "do_not_know": row["do_not_know"],
        "index": row["index"],
        "found": _format_interval(interval, ""),
    }


def _format_p(p: float | None) -> str:
    if p is None:
        return ""
    return f"< {format_number(0.001, 3)}" if p < 0.001 else format_number(p, 3)


def _of_protocol(found: OutcomeResult, one: Difference, unit: str) -> dict[str, str] | None:
    followed = found.of_protocol(one)
    return None if followed is None else _format_interval(followed.difference, unit)


def _tipping_point(point: float | None, unit: str) -> str:
    return f"{format_number(point, 1 if unit else 2)} {unit}".strip() if point else ""


def _format_interval(interval: Interval | None, unit: str) -> dict[str, str] | None:
    if interval is None:
        return None
    places = 1 if unit else 2
    low, high = (format_number(end, places) for end in (interval.low, interval.high))
    estimate = format_number(interval.estimate, places)
    within = "" if interval.low is None else f"{low} … {high}"
    return {"estimate": f"{estimate} {unit}".strip(), "within": within}


@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER, patients=False)  # audited here, as an export
@require_safe
def download_results(request: HttpRequest, study_id: int) -> HttpResponse:
    """Return a figure as SVG, or the data behind the figures as CSV: the ``file`` of that name."""
    study, user = _open(request, study_id)
    name, _point, kind = request.GET.get("file", "outcomes.csv").partition(".")
    known = {"svg": list(FIGURES), "csv": list(TABLES)}
    if name not in known.get(kind, []):
        raise Http404
    now = timezone.now()
    results = read_results(study, now)
    if not is_shown(results, name):
        raise PermissionDenied
    note_look(results, user, now)
    audit_log.record(Act.EXPORT, user, about=f"{study.code} {name}.{kind}", now=now)
    if kind == "svg":
        response = HttpResponse(FIGURES[name](results), content_type="image/svg+xml")
    else:
        text = write_table(TABLES[name](results), HEADERS.get(name, ()))
        response = HttpResponse(text, content_type="text/csv; charset=utf-8")
    response["Content-Disposition"] = f'attachment; filename="{study.code}-{name}.{kind}"'
    return response
