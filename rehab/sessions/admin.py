"""Admin of measures, protocols, presets and sessions."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from django import forms
from django.contrib import admin, messages
from django.core.exceptions import ValidationError
from django.db import transaction
from django.db.models import F, QuerySet
from django.http import HttpRequest, HttpResponseBase
from django.shortcuts import redirect
from django.urls import reverse
from django.utils.html import format_html, format_html_join
from django.utils.text import capfirst
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.access import person
from rehab.people.admin_base import ReadOnlyAdmin, RowFormSet, ScopedAdmin, ScopedOptions
from rehab.people.roles import Role
from rehab.sessions.corrections import SessionCorrection, may_correct, tell_corrections
from rehab.sessions.cues import list_gestures
from rehab.sessions.finding import Finder
from rehab.sessions.forms import STRIDE_S, minutes_of
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.presets import Preset
from rehab.sessions.protocols import Measure, Protocol, ProtocolPhase, say_shared
from rehab.sessions.trend import with_figures
from rehab.sessions.words import at_clinic
from rehab.training.changes import OPEN, State

PARKED = 10_000  # where phases wait while they change places; no protocol has as many


@admin.register(Measure)
class MeasureAdmin(ScopedAdmin):
    """Measures: the shared ones, and the clinic's own."""

    list_display = ("named", "unit", "higher_is_better", "goal_max", "whose")
    search_fields = ("name", "slug")

    @admin.display(description=_("name"), ordering="name")
    def named(self, measure: Measure) -> str:
        """Say its name."""
        return say_shared(measure)

    @admin.display(description=_("belongs to"), ordering="clinic")
    def whose(self, measure: Measure) -> str:
        """Say whether all clinics have it."""
        return gettext("all clinics") if measure.clinic_id is None else gettext("this clinic")


class PhaseForm(forms.ModelForm):
    """A phase as a row. Its place is where it stands: the page numbers the rows."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.fields["position"].required = False
        self.fields["position"].widget.attrs["class"] = "vIntegerField"

    def _get_validation_exclusions(self) -> set[str]:
        # Two rows may swap places; that each place is taken once is the page's business.
        return super()._get_validation_exclusions() | {"position"}  # type: ignore[misc, no-any-return]


class PhaseFormSet(RowFormSet):
    """The phases of one protocol, in the order of their numbers."""

    def clean(self) -> None:
        """Number the phases from 1 on. Refuses a protocol without any."""
        super().clean()
        if any(self.errors):
            return
        kept: list[tuple[float, int, ProtocolPhase]] = []
        for row, form in enumerate(self.forms):
            if form in self.deleted_forms or not (form.instance.pk or form.has_changed()):
                continue
            given = form.cleaned_data.get("position")
            above = kept[-1][0] if kept else 0.0  # a row without a number follows the one above
            kept.append((above if given is None else given, row, form.instance))
        if not kept:
            raise ValidationError(gettext("A protocol needs at least one phase. Add one below."))
        for position, (_given, _row, phase) in enumerate(sorted(kept, key=lambda k: k[:2]), 1):
            phase.position = position


class PhaseRows(ScopedOptions, admin.TabularInline):
    """A protocol's phases on its page."""

    model = ProtocolPhase
    form = PhaseForm
    formset = PhaseFormSet
    ordering = ("position",)
    fields = ("position", "kind", "name", "feedback", "gain", "strides", "seconds")

    def get_extra(self, request: HttpRequest, obj: Any = None, **options: Any) -> int:
        """Give a new protocol a row to begin with."""
        return 0 if obj else 1


@admin.register(Protocol)
class ProtocolAdmin(ScopedAdmin):
    """Protocols: the shared ones, and the clinic's own."""

    change_form_template = "sessions/admin_protocol.html"
    list_display = ("named", "whose", "phase_count", "length", "about")
    search_fields = ("name", "description", "phases__name")
    inlines = (PhaseRows,)
    actions = row_actions = for_viewers = ("copy_to_clinic",)

    def get_queryset(self, request: HttpRequest) -> QuerySet[Protocol]:
        """Give the visible protocols with their phases."""
        return super().get_queryset(request).prefetch_related("phases")

    @admin.display(description=_("belongs to"), ordering="clinic")
    def whose(self, protocol: Protocol) -> str:
        """Say whether all clinics have it."""
        return gettext("all clinics") if protocol.clinic_id is None else gettext("this clinic")

    @admin.display(description=_("name"), ordering="name")
    def named(self, protocol: Protocol) -> str:
        """Say its name."""
        return say_shared(protocol)

    @admin.display(description=_("description"))
    def about(self, protocol: Protocol) -> str:
        """Say what it is for."""
        return protocol.description if protocol.clinic_id else gettext(protocol.description)

    @admin.display(description=_("phases"))
    def phase_count(self, protocol: Protocol) -> int:
        """Count the phases."""
        return len(protocol.phases.all())

    @admin.display(description=_("takes"))
    def length(self, protocol: Protocol) -> str:
        """Say how long it takes, where every phase ends by itself."""
        minutes = minutes_of(protocol)
        return gettext("open end") if minutes is None else f"{minutes} min"

    def render_change_form(
        self, request: HttpRequest, context: dict[str, Any], *args: Any, **kwargs: Any
    ) -> Any:
        """Show the form; what is drawn of the protocol begins with what is stored."""
        row: Protocol | None = context.get("original")
        context["stride_s"] = STRIDE_S
        context["phases"] = [asdict(phase) for phase in (row.to_rules() if row else ())]
        return super().render_change_form(request, context, *args, **kwargs)

    @transaction.atomic
    def save_formset(self, request: HttpRequest, form: Any, formset: Any, change: bool) -> None:
        """Save the phases; each stands aside first, so that two can change places."""
        phases = ProtocolPhase.objects.visible_to(request.user).filter(protocol=form.instance)
        phases.update(position=F("position") + PARKED)
        super().save_formset(request, form, formset, change)
        for row in formset.initial_forms:
            if row not in formset.deleted_forms:
                phases.filter(pk=row.instance.pk).update(position=row.instance.position)

    def get_actions(self, request: HttpRequest) -> Any:
        """Give what can be done with several; only who has a clinic can copy to it."""
        actions = super().get_actions(request)
        if person(request).clinic_id is None or not self.has_add_permission(request):
            actions.pop("copy_to_clinic", None)
        return actions

    @admin.action(description=_("Copy to my clinic"))
    def copy_to_clinic(
        self, request: HttpRequest, protocols: QuerySet[Protocol]
    ) -> HttpResponseBase | None:
        """Make copies that the clinic can change."""
        made = [self._copy(request, protocol) for protocol in protocols]
        words = gettext("Copied: %(names)s. The copies are your clinic's to change.")
        messages.success(request, words % {"names": ", ".join(copy.name for copy in made)})
        if len(made) == 1:
            return redirect("admin:rehab_protocol_change", made[0].pk)
        return None

    @transaction.atomic
    def _copy(self, request: HttpRequest, protocol: Protocol) -> Protocol:
        taken = set(Protocol.objects.visible_to(request.user).values_list("name", flat=True))
        stem = protocol.name[:50]
        names = (f"{stem} ({gettext('copy')} {n})" for n in range(1, len(taken) + 2))
        copy = Protocol(
            clinic=person(request).clinic,
            name=next(name for name in names if name not in taken),
            description=protocol.description,
        )
        copy.save()
        for position, phase in enumerate(protocol.to_rules(), 1):
            ProtocolPhase(protocol=copy, position=position, **asdict(phase)).save()
        return copy


@admin.register(Preset)
class PresetAdmin(ScopedAdmin):
    """What the set-up offers as one tap."""

    list_display = ("name", "valence", "goal_words", "wanted_hits", "minutes", "protocol", "robot")
    list_filter = ("valence", "robot")
    list_select_related = ("protocol",)
    search_fields = ("name", "protocol__name")
    radio_fields = {"valence": admin.HORIZONTAL, "goal_by": admin.HORIZONTAL}
    fieldsets = (
        (None, {"fields": ("name", "valence", "protocol")}),
        (
            _("Goal"),
            {
                "fields": (
                    "goal_by",
                    ("goal_value", "goal_percent"),
                    ("wanted_hits", "minutes"),
                )
            },
        ),
        (
            _("Robot and source"),
            {"fields": ("robot", ("robot_above", "robot_below"), "source")},
        ),
    )

    def formfield_for_dbfield(self, db_field: Any, request: HttpRequest, **kwargs: Any) -> Any:
        """Offer the gestures that this clinic has."""
        if db_field.name in {"robot_above", "robot_below"}:
            return forms.ChoiceField(
                choices=list_gestures(person(request)), label=capfirst(db_field.verbose_name)
            )
        return super().formfield_for_dbfield(db_field, request, **kwargs)

    @admin.display(description=_("goal"))
    def goal_words(self, preset: Preset) -> str:
        """Say the goal."""
        return preset.goal_words


@admin.register(TrainingSession)
class TrainingSessionAdmin(ScopedAdmin):
    """Sessions to find and to read. Researchers see pseudonyms. Corrections have their own form."""

    list_display = (
        "date",
        "start_time",
        "patient",
        "types",
        "goal_value",
        "score",
        "hit_rate",
        "duration",
        "station",
        "state",
        "counts",
    )
    list_filter = (Finder, "valence", "state", "simulated", "left_out")
    search_fields = ("patient__nickname", "patient__code", "source")
    date_hierarchy = "created_at"
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
        "simulated",
        "log",
        "corrections",
    )
    readonly_fields = fields

    def get_queryset(self, request: HttpRequest) -> QuerySet[TrainingSession]:
        """Give the visible sessions with their score and hit rate."""
        return with_figures(request.user, super().get_queryset(request)).defer("plan")

    def get_object(self, request: HttpRequest, *args: Any, **kwargs: Any) -> Any:
        """Give a session with its corrections as this person may read them."""
        row = super().get_object(request, *args, **kwargs)
        if row is not None:
            row.told = tell_corrections(row, person(request))
        return row

    def get_list_display(self, request: HttpRequest) -> Any:
        """Give the columns."""
        return self._for(request, self.list_display)

    def get_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Give the fields."""
        return self._for(request, self.fields)

    def get_readonly_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Give the same fields: nothing here is edited."""
        return self._for(request, self.fields)

    def get_search_fields(self, request: HttpRequest) -> Any:
        """Give what can be searched: for researchers nothing that leads to a person."""
        if person(request).role == Role.RESEARCHER:
            return ("patient__pseudonym",)
        return self.search_fields

    def get_row_links(self, request: HttpRequest, row: Any) -> list[tuple[str, Any]]:
        """Lead to the session's own pages, and to the form that corrects it."""
        links = [(reverse("session", args=[row.pk]), _("Every stride"))]
        if person(request).role == Role.RESEARCHER:
            return links
        if State(row.state) in OPEN:
            links.append((reverse("monitor", args=[row.pk]), _("Monitor")))
        if may_correct(row):
            links.append((reverse("correct", args=[row.pk]), _("Correct")))
        return links

    def _for(self, request: HttpRequest, names: tuple[str, ...]) -> tuple[str, ...]:
        if person(request).role != Role.RESEARCHER:
            return names
        # A source may be a file that is named after a person.
        seen = (name for name in names if name != "source")
        return tuple("pseudonym" if name == "patient" else name for name in seen)

    @admin.display(description=_("patient"), ordering="patient__pseudonym")
    def pseudonym(self, session: TrainingSession) -> str:
        """Give the patient's pseudonym."""
        return session.patient.pseudonym

    @admin.display(description=_("date"), ordering="created_at")
    def date(self, session: TrainingSession) -> Any:
        """Give the day of the session by the clinic's clock."""
        return at_clinic(session.started_at or session.created_at, session.clinic).date()

    @admin.display(description=_("start time"), ordering="started_at")
    def start_time(self, session: TrainingSession) -> str | None:
        """Give the time of day that it began."""
        if session.started_at is None:
            return None
        return f"{at_clinic(session.started_at, session.clinic):%H:%M:%S}"

    @admin.display(description=_("duration"), ordering="active_s")
    def duration(self, session: TrainingSession) -> str:
        """Give the walked time in minutes and seconds."""
        minutes, seconds = divmod(round(session.active_s), 60)
        return f"{minutes}:{seconds:02d}"

    @admin.display(description=_("feedback type"), ordering="valence")
    def types(self, session: TrainingSession) -> str:
        """Give the feedback type, and those it was changed to."""
        return session.types_words

    @admin.display(description=_("goal"), ordering="goal")
    def goal_value(self, session: TrainingSession) -> str | None:
        """Give the goal with its unit."""
        return None if session.goal is None else f"{session.goal:.2f} {session.measure.unit}"

    @admin.display(description=_("score"), ordering="metric_score")
    def score(self, session: Any) -> int | None:
        """Give the points; none for explicit feedback and sessions that have not ended."""
        return None if session.metric_score is None else round(session.metric_score)

    @admin.display(description=_("hit rate"), ordering="metric_hit_rate")
    def hit_rate(self, session: Any) -> str | None:
        """Give the share of hits."""
        return None if session.metric_hit_rate is None else f"{session.metric_hit_rate:.0%}"

    @admin.display(description=_("counts"), ordering="left_out", boolean=True)
    def counts(self, session: TrainingSession) -> bool:
        """Say whether it is in figures, boards and trends."""
        return not session.left_out

    @admin.display(description=_("log"))
    def log(self, session: TrainingSession) -> str:
        """Lead to the session's steps, events and metrics."""
        return format_html(
            '<a href="{}?session__id__exact={}">{}</a> · '
            '<a href="{}?session__id__exact={}">{}</a> · '
            '<a href="{}?session__id__exact={}">{}</a>',
            *(reverse("admin:rehab_step_changelist"), session.pk, gettext("Steps")),
            *(reverse("admin:rehab_sessionevent_changelist"), session.pk, gettext("Events")),
            *(reverse("admin:rehab_sessionmetric_changelist"), session.pk, gettext("Metrics")),
        )

    @admin.display(description=_("corrections"))
    def corrections(self, session: Any) -> str:
        """Tell the corrections, newest first."""
        if not session.told:
            return gettext("none")
        return format_html_join(
            "",
            "<p><b>{}</b>: {} → {}<br>{} · {}<br>{}</p>",
            (
                (
                    told["row"].get_part_display(),
                    told["old"] or "–",
                    told["new"] or "–",
                    told["row"].by or "–",
                    f"{at_clinic(told['row'].at, session.clinic):%Y-%m-%d %H:%M}",
                    told["row"].reason,
                )
                for told in session.told
            ),
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
    list_filter = ("valid", "hit", "side")
    list_select_related = ("session",)


@admin.register(SessionEvent)
class SessionEventAdmin(ReadOnlyAdmin):
    """A session's events."""

    list_display = ("session", "after_number", "kind", "old", "value", "by", "at", "data")
    list_filter = ("kind",)
    list_select_related = ("session", "by")


@admin.register(SessionMetric)
class SessionMetricAdmin(ReadOnlyAdmin):
    """A session's figures."""

    list_display = ("session", "slug", "value")
    list_filter = ("slug",)
    list_select_related = ("session",)


@admin.register(SessionCorrection)
class SessionCorrectionAdmin(ReadOnlyAdmin):
    """What was corrected of sessions, to read."""

    list_display = ("session", "part", "old", "new", "reason", "by", "at")
    list_filter = ("part", "at")
    list_select_related = ("session", "by")

    def has_add_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Corrections are made in their own form."""
        return False
