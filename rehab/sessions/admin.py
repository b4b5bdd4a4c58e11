"""Admin of measures, protocols and sessions."""

from __future__ import annotations

from typing import Any

from django.contrib import admin
from django.contrib.admin import RelatedOnlyFieldListFilter
from django.db.models import QuerySet
from django.http import HttpRequest
from django.urls import reverse
from django.utils.html import format_html

from rehab.people.access import person
from rehab.people.admin_base import ReadOnlyAdmin, ScopedAdmin, ScopedOptions
from rehab.people.roles import Role
from rehab.sessions.models import (
    Measure,
    Protocol,
    ProtocolPhase,
    SessionEvent,
    SessionMetric,
    Step,
    TrainingSession,
)
from rehab.sessions.trend import with_figures


@admin.register(Measure)
class MeasureAdmin(ScopedAdmin):
    """Measures: the shared ones, and the clinic's own."""

    list_display = ("name", "unit", "higher_is_better", "goal_max")


class PhaseRows(ScopedOptions, admin.TabularInline):
    """A protocol's phases on its page."""

    model = ProtocolPhase
    extra = 0
    ordering = ("position",)


@admin.register(Protocol)
class ProtocolAdmin(ScopedAdmin):
    """Protocols: the shared ones, and the clinic's own."""

    list_display = ("name", "description")
    search_fields = ("name",)
    inlines = (PhaseRows,)


@admin.register(TrainingSession)
class TrainingSessionAdmin(ScopedAdmin):
    """Sessions to read. Researchers see pseudonyms."""

    list_display = (
        "date",
        "start_time",
        "duration",
        "patient",
        "types",
        "goal_value",
        "score",
        "hit_rate",
        "state",
    )
    list_filter = ("valence", "state", "created_at", ("station", RelatedOnlyFieldListFilter))
    search_fields = ("patient__nickname", "patient__code", "source")
    date_hierarchy = "created_at"
    list_select_related = ("patient", "measure", "station")
    fields = (
        "patient",
        "date",
        "start_time",
        "duration",
        "types",
        "goal_value",
        "score",
        "hit_rate",
        "state",
        "trained_side",
        "measure",
        "protocol",
        "station",
        "source",
        "simulated",
        "log",
    )
    readonly_fields = fields

    def get_queryset(self, request: HttpRequest) -> QuerySet[TrainingSession]:
        """Give the visible sessions with their score and hit rate."""
        return with_figures(request.user, super().get_queryset(request))

    def get_list_display(self, request: HttpRequest) -> Any:
        """Give the columns."""
        return self._for(request, self.list_display)

    def get_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Give the fields."""
        return self._for(request, self.fields)

    def get_readonly_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Give the same fields: nothing here is edited."""
        return self.get_fields(request, obj)

    def get_search_fields(self, request: HttpRequest) -> Any:
        """Give what can be searched: for researchers nothing that leads to a person."""
        if person(request).role == Role.RESEARCHER:
            return ("patient__pseudonym",)
        return self.search_fields

    def _for(self, request: HttpRequest, names: tuple[str, ...]) -> tuple[str, ...]:
        if person(request).role != Role.RESEARCHER:
            return names
        return tuple("pseudonym" if name == "patient" else name for name in names)

    @admin.display(description="patient", ordering="patient__pseudonym")
    def pseudonym(self, session: TrainingSession) -> str:
        """Give the patient's pseudonym."""
        return session.patient.pseudonym

    @admin.display(description="date", ordering="created_at")
    def date(self, session: TrainingSession) -> Any:
        """Give the day of the session."""
        return (session.started_at or session.created_at).date()

    @admin.display(description="start time", ordering="started_at")
    def start_time(self, session: TrainingSession) -> str | None:
        """Give the time of day that it began."""
        return None if session.started_at is None else f"{session.started_at:%H:%M:%S}"

    @admin.display(description="duration", ordering="active_s")
    def duration(self, session: TrainingSession) -> str:
        """Give the walked time in minutes and seconds."""
        minutes, seconds = divmod(round(session.active_s), 60)
        return f"{minutes}:{seconds:02d}"

    @admin.display(description="feedback type", ordering="valence")
    def types(self, session: TrainingSession) -> str:
        """Give the feedback type, and those it was changed to."""
        return session.types_words

    @admin.display(description="goal", ordering="goal")
    def goal_value(self, session: TrainingSession) -> str | None:
        """Give the goal with its unit."""
        return None if session.goal is None else f"{session.goal:.2f} {session.measure.unit}"

    @admin.display(description="score", ordering="metric_score")
    def score(self, session: Any) -> int | None:
        """Give the points; none for explicit feedback and sessions that have not ended."""
        return None if session.metric_score is None else round(session.metric_score)

    @admin.display(description="hit rate", ordering="metric_hit_rate")
    def hit_rate(self, session: Any) -> str | None:
        """Give the share of hits."""
        return None if session.metric_hit_rate is None else f"{session.metric_hit_rate:.0%}"

    @admin.display(description="log")
    def log(self, session: TrainingSession) -> str:
        """Lead to the session's steps, events and metrics."""
        return format_html(
            '<a href="{}?session__id__exact={}">Steps</a> · '
            '<a href="{}?session__id__exact={}">Events</a> · '
            '<a href="{}?session__id__exact={}">Metrics</a>',
            reverse("admin:rehab_step_changelist"),
            session.pk,
            reverse("admin:rehab_sessionevent_changelist"),
            session.pk,
            reverse("admin:rehab_sessionmetric_changelist"),
            session.pk,
        )


@admin.register(Step)
class StepAdmin(ReadOnlyAdmin):
    """A session's steps."""

    list_display = (
        "session",
        "number",
        "time_s",
        "phase",
        "value",
        "shown",
        "goal",
        "performance",
        "hit",
        "points",
        "valid",
        "reasons",
    )
    list_select_related = ("session",)


@admin.register(SessionEvent)
class SessionEventAdmin(ReadOnlyAdmin):
    """A session's events."""

    list_display = ("session", "after_number", "kind", "old", "value", "by", "at", "data")
    list_select_related = ("session", "by")


@admin.register(SessionMetric)
class SessionMetricAdmin(ReadOnlyAdmin):
    """A session's figures."""

    list_display = ("session", "slug", "value")
    list_select_related = ("session",)
