"""Admin of measures and protocols."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, ClassVar

from django import forms
from django.contrib import admin, messages
from django.contrib.admin.widgets import AdminTextareaWidget
from django.core.exceptions import ValidationError
from django.db import models, transaction
from django.db.models import F, QuerySet
from django.http import HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import redirect
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.access import user_of
from rehab.people.ranges import NumberField
from rehab.people.web.admin_base import ScopedAdmin, ScopedOptions
from rehab.people.web.row_forms import ClinicForm, LabeledFormSet
from rehab.sessions.formatting import format_number, yes_or_no
from rehab.sessions.questionnaires import questionnaire_choices
from rehab.sessions.setup.presets import Preset
from rehab.sessions.setup.protocol_models import (
    MeasureDefinition,
    Protocol,
    ProtocolPhase,
    display_name,
)
from rehab.sessions.setup.protocol_outline import (
    STRIDE_S,
    describe_phase_end,
    format_planned,
    protocol_minutes,
)

TEMPORARY_OFFSET = (
    10_000  # of positions while phases change places; no protocol has this many phases
)


class SharedAdmin(ScopedAdmin):
    """Admin of rows that are the clinic's own or shared by all."""

    @admin.display(description=_("name"), ordering="name")
    def named(self, row: MeasureDefinition | Protocol) -> str:
        """Its name."""
        return display_name(row)

    @admin.display(description=_("belongs to"), ordering="clinic")
    def whose(self, row: MeasureDefinition | Protocol) -> str:
        """Whether all clinics have it."""
        return gettext("all clinics") if row.clinic_id is None else gettext("this clinic")


@admin.register(MeasureDefinition)
class MeasureAdmin(SharedAdmin):
    """Measures: the shared ones, and the clinic's own."""

    list_display = ("named", "unit", "higher_is_better", "goal_max", "whose")
    search_fields = ("name", "slug")


class PercentField(NumberField):
    """A share, read and written in percent."""

    def clean(self, value: Any) -> Any:
        """Return the share."""
        percent = super().clean(value)
        return None if percent is None else percent / 100


class PhaseForm(forms.ModelForm):
    """A phase as a row; its position is that of the row, which the page numbers."""

    gain = PercentField(
        label=_("gain, %"),
        initial=100,
        least=50,
        most=150,
        unit="%",
        help_text=_("How much of the measured value is shown, 50 to 150 %."),
    )

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        if "gain" in self.initial:
            self.initial["gain"] = round(100 * self.initial["gain"], 4)
        for name, value in self.initial.items():
            if isinstance(value, float) and value.is_integer():
                self.initial[name] = int(value)  # 60 s, not 60.0 s
        position = self.fields.get("position")
        if position is not None:  # not in a page that can only be read
            position.required = False
            position.widget.attrs["class"] = "vIntegerField"

    def _get_validation_exclusions(self) -> set[str]:
        # Two rows may swap positions; `PhaseFormSet` numbers them without duplicates.
        return super()._get_validation_exclusions() | {"position"}  # type: ignore[misc, no-any-return]


class PhaseFormSet(LabeledFormSet):
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


class PhaseInline(ScopedOptions, admin.TabularInline):
    """A protocol's phases on its page."""

    model = ProtocolPhase
    form = PhaseForm
    formset = PhaseFormSet
    ordering = ("position",)
    readonly_fields = ("named", "with_feedback", "shown", "length", "goal", "with_robot", "rest")
    fields = (
        "position",
        "kind",
        "name",
        "feedback",
        "gain",
        "strides",
        "seconds",
        "goal_percent",
        "robot",
        "rest_s",
    )

    def get_extra(self, request: HttpRequest, obj: Any = None, **options: Any) -> int:
        """Return one empty row for a new protocol."""
        return 0 if obj else 1

    def get_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the fields; names that can only be read are in the page's language."""
        return self.fields if self.has_change_permission(request, obj) else self.readonly_fields

    @admin.display(description=_("name"))
    def named(self, phase: ProtocolPhase) -> str:
        """Its name."""
        return str(phase)

    @admin.display(description=_("feedback"))
    def with_feedback(self, phase: ProtocolPhase) -> str:
        """Whether the patient gets feedback."""
        return yes_or_no(phase.feedback)

    @admin.display(description=_("gain"))
    def shown(self, phase: ProtocolPhase) -> str:
        """Its gain in percent."""
        return f"{format_number(100 * phase.gain, 0)} %"

    @admin.display(description=_("ends after"))
    def length(self, phase: ProtocolPhase) -> str:
        """What ends it."""
        return describe_phase_end(phase.to_rule())

    @admin.display(description=_("goal"))
    def goal(self, phase: ProtocolPhase) -> str:
        """The goal from here on, in percent of the baseline."""
        percent = phase.goal_percent
        return gettext("stays") if percent is None else f"{format_number(percent, 0)} %"

    @admin.display(description=_("robot"))
    def with_robot(self, phase: ProtocolPhase) -> str:
        """Whether the robot answers."""
        return yes_or_no(phase.robot)

    @admin.display(description=_("rest"))
    def rest(self, phase: ProtocolPhase) -> str:
        """The pause after it."""
        return format_planned(phase.rest_s) if phase.rest_s else gettext("none")


class ProtocolForm(ClinicForm):
    """A protocol; what is asked after it is chosen from what the clinic has."""

    clinic_id: int | None = None
    questionnaires = forms.MultipleChoiceField(
        label=_("Asked after the session"), required=False, widget=forms.CheckboxSelectMultiple
    )

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        field: Any = self.fields.get("questionnaires")
        if field is not None:  # not in a page that can only be read
            field.choices = questionnaire_choices(self.clinic_id)


@admin.register(Protocol)
class ProtocolAdmin(SharedAdmin):
    """Protocols: the shared ones, and the clinic's own."""

    form = ProtocolForm
    change_form_template = "sessions/protocol_form.html"
    delete_confirmation_template = "sessions/protocol_delete.html"
    list_display = ("named", "phase_count", "length", "whose", "about")
    search_fields = ("name", "description", "phases__name")
    formfield_overrides: ClassVar[Any] = {
        models.TextField: {"widget": AdminTextareaWidget(attrs={"rows": 3})}
    }
    inlines = (PhaseInline,)
    actions = row_actions = viewer_actions = ("copy_to_clinic",)

    def get_queryset(self, request: HttpRequest) -> QuerySet[Protocol]:
        """Return the visible protocols with their phases."""
        return super().get_queryset(request).prefetch_related("phases")

    def get_form(self, request: HttpRequest, *args: Any, **options: Any) -> Any:
        """Return the form with the questionnaires of the person's clinic."""
        form = super().get_form(request, *args, **options)
        form.clinic_id = user_of(request).clinic_id
        return form

    def get_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the fields; words that can only be read are in the page's language."""
        fields = list(super().get_fields(request, obj))
        if obj is None or self.has_change_permission(request, obj):
            return fields
        readable: dict[Any, str] = {"name": "named", "description": "about"}
        return [readable.get(field, field) for field in fields]

    def get_fieldsets(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the name, which stands above the drawing, and the other fields.

        A protocol that can only be read has its name in the title.
        """
        [(_title, options)] = super().get_fieldsets(request, obj)
        name, *others = options["fields"]
        may_change = obj is None or self.has_change_permission(request, obj)
        return [(None, {"fields": [name] * may_change}), (None, {"fields": others})]

    @admin.display(description=_("description"))
    def about(self, protocol: Protocol) -> str:
        """Its description."""
        return protocol.description if protocol.clinic_id else gettext(protocol.description)

    @admin.display(description=_("phases"))
    def phase_count(self, protocol: Protocol) -> int:
        """The number of phases."""
        return len(protocol.phases.all())

    @admin.display(description=_("takes"))
    def length(self, protocol: Protocol) -> str:
        """Its duration, where every phase ends by itself."""
        minutes = protocol_minutes(protocol)
        return gettext("open end") if minutes is None else f"{minutes} min"

    def render_change_form(
        self, request: HttpRequest, context: dict[str, Any], *args: Any, **kwargs: Any
    ) -> Any:
        """Show the form with a drawing of the stored protocol."""
        row: Protocol | None = context.get("original")
        context["stride_s"] = STRIDE_S
        phases = row.to_rules() if row else ()
        context["phases"] = [asdict(phase) | {"name": gettext(phase.name)} for phase in phases]
        return super().render_change_form(request, context, *args, **kwargs)

    def render_delete_form(self, request: HttpRequest, context: dict[str, Any]) -> HttpResponse:
        """Show first which presets are deleted as well."""
        protocol: Protocol = context["object"]
        presets = Preset.objects.visible_to(request.user).filter(protocol=protocol)
        context["presets"] = list(presets.values_list("name", flat=True))
        return super().render_delete_form(request, context)

    @transaction.atomic
    def save_formset(self, request: HttpRequest, form: Any, formset: Any, change: bool) -> None:
        """Save the phases, all moved aside first, so that two can change places."""
        phases = ProtocolPhase.objects.visible_to(request.user).filter(protocol=form.instance)
        phases.update(position=F("position") + TEMPORARY_OFFSET)
        super().save_formset(request, form, formset, change)
        for row in formset.initial_forms:
            if row not in formset.deleted_forms:
                phases.filter(pk=row.instance.pk).update(position=row.instance.position)

    def get_actions(self, request: HttpRequest) -> Any:
        """Return the actions; copying needs a clinic to copy to."""
        actions = super().get_actions(request)
        if user_of(request).clinic_id is None or not self.has_add_permission(request):
            actions.pop("copy_to_clinic", None)
        return actions

    @admin.action(description=_("Copy to my clinic"))
    def copy_to_clinic(
        self, request: HttpRequest, protocols: QuerySet[Protocol]
    ) -> HttpResponseBase | None:
        """Copy protocols into the clinic, which can then change them."""
        made = [self._copy(request, protocol) for protocol in protocols]
        message = gettext("Copied: %(names)s. The copies are your clinic's to change.")
        messages.success(request, message % {"names": ", ".join(copy.name for copy in made)})
        if len(made) == 1:
            return redirect("admin:rehab_protocol_change", made[0].pk)
        return None

    @transaction.atomic
    def _copy(self, request: HttpRequest, protocol: Protocol) -> Protocol:
        taken = set(Protocol.objects.visible_to(request.user).values_list("name", flat=True))
        stem = protocol.name[:50]
        names = (f"{stem} ({gettext('copy')} {n})" for n in range(1, len(taken) + 2))
        copy = Protocol(
            clinic=user_of(request).clinic,
            name=next(name for name in names if name not in taken),
            description=protocol.description,
            wanted_hits=protocol.wanted_hits,
            close_percent=protocol.close_percent,
            questionnaires=protocol.questionnaires,
        )
        copy.save()
        for position, phase in enumerate(protocol.to_rules(), 1):
            ProtocolPhase(protocol=copy, position=position, **asdict(phase)).save()
        return copy
