"""A study's figures for its sponsor: how far it is and what went wrong, and no person."""

from __future__ import annotations

from collections.abc import Iterator

from django.core.exceptions import PermissionDenied
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.utils.translation import gettext
from django.views.decorators.http import require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.roles import Role
from rehab.studies.models import Study, StudyState
from rehab.studies.pages.planning import get_study
from rehab.studies.pages.results import describe_outcome
from rehab.studies.record.adverse_events import AdverseEvent
from rehab.studies.results.results import Results, read_results

Row = tuple[str, object]


@for_roles(Role.LEAD, Role.RESEARCHER, Role.SPONSOR, patients=False)
@require_safe
def show_figures(request: HttpRequest, study_id: int) -> HttpResponse:
    """Show how far a study is, over all arms together; once it is closed, what it found."""
    study = get_study(user_of(request), study_id)
    if study.is_draft:
        raise PermissionDenied
    results = read_results(study, timezone.now())
    is_closed = study.state == StudyState.CLOSED
    context = {
        "study": study,
        "parts": [
            (gettext("Participants"), list(_count_people(study, results))),
            (gettext("Visits"), list(_count_visits(results))),
            (gettext("Harms"), list(_count_harms(study, results))),
        ],
        "registered": [describe_outcome(results, slug) for slug in results.registered]
        if is_closed
        else [],
    }
    return render(request, "studies/figures.html", context)


def _count_people(study: Study, results: Results) -> Iterator[Row]:
    people, assessed = results.participants, results.assessed
    yield gettext("planned"), study.participants
    yield gettext("assessed"), assessed.people
    yield gettext("not eligible"), assessed.not_eligible
    yield gettext("declined"), assessed.declined
    yield gettext("enrolled"), len(people)
    yield gettext("left the study"), sum(one.has_left for one in people)


def _count_visits(results: Results) -> Iterator[Row]:
    flow = results.flow
    yield gettext("due"), sum(one.visits_planned for one in flow)
    yield gettext("walked"), sum(one.visits_walked for one in flow)
    yield gettext("ended early"), sum(one.visits_unfinished for one in flow)
    yield gettext("left out"), sum(one.visits_excluded for one in flow)


def _count_harms(study: Study, results: Results) -> Iterator[Row]:
    """Yield how often each harm happened in all arms, and what became of adverse events."""
    for row in results.conduct:
        if row.kind == "harm":
            yield row.label, sum(events for events, _people in row.counts.values())
    events = AdverseEvent.everywhere.filter(enrollment__study=study)
    serious = [one for one in events if one.is_serious]
    yield gettext("adverse events that were judged"), len(events)
    yield gettext("serious"), len(serious)
    yield gettext("serious, not reported yet"), sum(one.reported_at is None for one in serious)
