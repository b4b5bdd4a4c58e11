"""Admin of sessions, their log and their corrections."""

from __future__ import annotations

from typing import Any

from django.contrib import admin
from django.db.models import QuerySet
from django.http import HttpRequest, HttpResponse
from django.urls import reverse
from django.utils.formats import date_format
from django.utils.html import format_html, format_html_join
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.access import user_of
from rehab.people.roles import may_see_names
from rehab.people.web.admin_base import ReadOnlyAdmin, ScopedAdmin
from rehab.sessions.admin.filters import (
    LeftOutFilter,
    PeriodFilter,
    SimulatedFilter,
    StateFilter,
    TypeFilter,
)
from rehab.sessions.corrections import SessionCorrection, can_correct, describe_corrections
from rehab.sessions.formatting import (
    clinic_time,
    format_duration,
    format_number,
    format_quantity,
    format_rate,
    format_state,
    yes_or_no,
)
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.search import SessionSearchFilter
from rehab.sessions.reports.trend import with_metrics
from rehab.sessions.robot_incidents import RobotIncident
from rehab.sessions.step_columns import STEP_COLUMNS
from rehab.training.changes import OPEN_STATES, State


@admin.register(TrainingSession)
class TrainingSessionAdmin(ScopedAdmin):
    """Sessions, read-only. Researchers see pseudonyms. Corrections have their own form."""

    list_display = (
        "who",
        "day",
        "kind",
        "hit_rate",
        "score",
        "duration",
    )
    list_display_links = None
    list_filter = (
        ("valence", TypeFilter),
        PeriodFilter,
        ("state", StateFilter),
        ("excluded", LeftOutFilter),
        SimulatedFilter,
        SessionSearchFilter,
    )
    search_fields = ("patient__nickname", "patient__code", "source")
    list_select_related = ("patient", "measure", "station", "clinic")
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
        "counts",
        "trained_side",
        "measure",
        "protocol",
        "station",
        "source",
        "made_up",
        "log",
        "corrections",
    )
    readonly_fields = fields

    def get_queryset(self, request: HttpRequest) -> QuerySet[TrainingSession]:
        """Return the visible sessions with their score and hit rate."""
        return with_metrics(request.user, super().get_queryset(request)).defer("plan")

    def get_object(self, request: HttpRequest, *args: Any, **kwargs: Any) -> Any:
        """Return a session with its corrections as this person may read them."""
        row = super().get_object(request, *args, **kwargs)
        if row is not None:
            row.described_corrections = describe_corrections(row, user_of(request))
        return row

    def get_list_display(self, request: HttpRequest) -> Any:
        """Return the columns."""
        return self._for(request, self.list_display)

    def get_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the fields."""
        return self._for(request, self.fields)

    def get_readonly_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the same fields: nothing here is edited."""
        return self._for(request, self.fields)

    def get_search_fields(self, request: HttpRequest) -> Any:
        """Return what can be searched: for researchers nothing that identifies a person."""
        if not may_see_names(user_of(request).role):
            return ("patient__pseudonym",)
        return self.search_fields

    def get_row_links(self, request: HttpRequest, row: Any) -> list[tuple[str, Any]]:
        """Return links to the session's own pages, and to the form that corrects it."""
        links = [(reverse("session", args=[row.pk]), _("Open the session"))]
        if not may_see_names(user_of(request).role):
            return links
        if State(row.state) in OPEN_STATES:
            links.append((reverse("monitor", args=[row.pk]), _("Therapist’s page")))
        if can_correct(row):
            links.append((reverse("correct", args=[row.pk]), _("Correct")))
        return links

    def render_change_form(
        self, request: HttpRequest, context: dict[str, Any], *args: Any, **kwargs: Any
    ) -> HttpResponse:
        """Show the session, by whom it was walked and when."""
        session = context["original"]
        is_named = may_see_names(user_of(request).role)
        who = session.patient.nickname if is_named else session.patient.pseudonym
        when = filter(None, (self.date(session), self.start_time(session)))
        context |= {"title": ", ".join((who, *when)), "subtitle": None}
        return super().render_change_form(request, context, *args, **kwargs)

    def _for(self, request: HttpRequest, names: tuple[str, ...]) -> tuple[str, ...]:
        if may_see_names(user_of(request).role):
            return names
        # A source may be a file that is named after a person.
        shown = (name for name in names if name != "source")
        coded = {"patient": "pseudonym", "who": "coded"}
        return tuple(coded.get(name, name) for name in shown)

    @admin.display(description=_("patient"), ordering="patient__nickname")
    def who(self, session: TrainingSession) -> str:
        """The patient's name and code, which lead to the session's page."""
        return _link_to_page(session, session.patient.nickname, session.patient.code)

    @admin.display(description=_("patient"), ordering="patient__pseudonym")
    def coded(self, session: TrainingSession) -> str:
        """The patient's pseudonym, which leads to the session's page."""
        return _link_to_page(session, session.patient.pseudonym)

    @admin.display(description=_("date"), ordering="created_at")
    def day(self, session: TrainingSession) -> str:
        """The day, below it the time and the place, and what is unusual about it."""
        below = (self.start_time(session), session.station.name if session.station else None)
        state = format_state(session.state)
        unusual = (
            gettext("simulated") if session.simulated else "",
            gettext("left out of figures") if session.excluded else "",
        )
        return format_html(
            '{} <br><span class="muted s">{}</span>{}{}',
            self.date(session),
            " · ".join(filter(None, below)),
            format_html(' <span class="badge free">{}</span>', state) if state else "",
            format_html_join(
                "", ' <span class="badge warn">{}</span>', ((word,) for word in unusual if word)
            ),
        )

    @admin.display(description=_("feedback type"), ordering="valence")
    def kind(self, session: TrainingSession) -> str:
        """The type with its sign, and below it the goal."""
        return format_html(
            '<span class="row"><span class="type {0}" data-theme="{0}" aria-hidden="true"></span>'
            '<span>{1}<br><span class="muted s">{2}</span></span></span>',
            session.valence,
            session.valences_label,
            gettext("goal %(goal)s") % {"goal": format_quantity(session.goal, session.measure.unit)}
            if session.goal is not None
            else "",
        )

    @admin.display(description=_("patient"), ordering="patient__pseudonym")
    def pseudonym(self, session: TrainingSession) -> str:
        """The patient's pseudonym."""
        return session.patient.pseudonym

    @admin.display(description=_("date"), ordering="created_at")
    def date(self, session: TrainingSession) -> str:
        """The day of the session in the clinic's time zone."""
        return date_format(clinic_time(session.began_at, session.clinic), "DATE_FORMAT")

    @admin.display(description=_("start time"), ordering="started_at")
    def start_time(self, session: TrainingSession) -> str:
        """The time of day when it was started; "" before."""
        if session.started_at is None:
            return ""
        return f"{clinic_time(session.started_at, session.clinic):%H:%M}"

    @admin.display(description=_("duration"), ordering="active_s")
    def duration(self, session: TrainingSession) -> str:
        """The walked time; "" where nobody walked yet."""
        return format_duration(session.active_s) if session.active_s else ""

    @admin.display(description=_("feedback type"), ordering="valence")
    def types(self, session: TrainingSession) -> str:
        """The feedback type, and those it was changed to."""
        return session.valences_label

    @admin.display(description=_("goal"), ordering="goal")
    def goal_value(self, session: TrainingSession) -> str:
        """The goal with its unit; "" where it has none."""
        return "" if session.goal is None else f"{session.goal:.2f} {session.measure.unit}"

    @admin.display(description=_("score"), ordering="metric_score")
    def score(self, session: Any) -> str:
        """The points; "" for explicit feedback and sessions that have not ended."""
        if session.metric_score is None:
            return ""
        return gettext("%(score)s points") % {"score": format_number(session.metric_score, 0)}

    @admin.display(description=_("hit rate"), ordering="metric_hit_rate")
    def hit_rate(self, session: Any) -> str:
        """The share of hits; "" before its end."""
        if session.metric_hit_rate is None:
            return ""
        return format_html(
            "<b>{}</b> {}",
            format_rate(session.metric_hit_rate),
            gettext("hits"),
        )

    @admin.display(description=_("counts"), ordering="excluded")
    def counts(self, session: TrainingSession) -> str:
        """Whether it is in figures, boards and trends."""
        return yes_or_no(not session.excluded)

    @admin.display(description=_("simulated"), ordering="simulated")
    def made_up(self, session: TrainingSession) -> str:
        """Whether nobody walked it."""
        return yes_or_no(session.simulated)

    @admin.display(description=_("log"))
    def log(self, session: TrainingSession) -> str:
        """Links to the session's steps, events and metrics."""
        lists = {"step": _("Steps"), "sessionevent": _("Events"), "sessionmetric": _("Metrics")}
        return format_html_join(
            " · ",
            '<a href="{}?session__id__exact={}">{}</a>',
            (
                (reverse(f"admin:rehab_{model}_changelist"), session.pk, label)
                for model, label in lists.items()
            ),
        )

    @admin.display(description=_("corrections"))
    def corrections(self, session: Any) -> str:
        """The corrections, newest first."""
        if not session.described_corrections:
            return gettext("none")
        return format_html_join(
            "",
            "<p><b>{}</b>: {} → {}<br>{} · {}<br>{}</p>",
            (
                (
                    entry.row.get_field_display(),
                    entry.old or "–",
                    entry.new or "–",
                    entry.by or "–",
                    date_format(entry.at, "DATETIME_FORMAT"),
                    entry.row.reason,
                )
                for entry in session.described_corrections
            ),
        )


def _link_to_page(session: TrainingSession, name: str, code: str = "") -> str:
    return format_html(
        '<a href="{}"><span><b>{}</b> <br><span class="muted s">{}</span></span></a>',
        reverse("session", args=[session.pk]),
        name,
        code,
    )


class SessionLogAdmin(ReadOnlyAdmin):
    """Pages of a session's log, linked from the session's own page."""

    link_lookups = ("session__id__exact",)


@admin.register(Step)
class StepAdmin(SessionLogAdmin):
    """A session's steps."""

    list_display = ("session", *(column.field for column in STEP_COLUMNS))
    list_filter = ("valid", "hit", "side")
    list_select_related = ("session",)


@admin.register(SessionEvent)
class SessionEventAdmin(SessionLogAdmin):
    """A session's events."""

    list_display = ("session", "after_number", "kind", "old", "value", "by", "at", "data")
    list_filter = ("kind",)
    list_select_related = ("session", "by")


@admin.register(SessionMetric)
class SessionMetricAdmin(SessionLogAdmin):
    """A session's figures."""

    list_display = ("session", "slug", "value")
    list_filter = ("slug",)
    list_select_related = ("session",)


@admin.register(RobotIncident)
class RobotIncidentAdmin(SessionLogAdmin):
    """What robots recorded around their stops."""

    list_display = ("session", "at", "reason")
    list_filter = ("reason",)
    exclude = ("recording",)
    list_select_related = ("session",)


@admin.register(SessionCorrection)
class SessionCorrectionAdmin(ReadOnlyAdmin):
    """Corrections of sessions, read-only."""

    list_display = ("session", "field", "old", "new", "reason", "by", "at")
    list_filter = ("field", "at")
    list_select_related = ("session", "by")

    def has_add_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Return False: corrections are made in their own form."""
        return False
