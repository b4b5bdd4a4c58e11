"""Admin of presets and of a clinic's own questionnaires and tests."""

from __future__ import annotations

from typing import Any, ClassVar

from django.contrib import admin
from django.db.models import QuerySet
from django.http import HttpRequest
from django.utils.translation import gettext_lazy as _

from rehab.people.access import user_of
from rehab.people.web.admin_base import ScopedAdmin
from rehab.people.web.row_forms import ClinicForm
from rehab.sessions.available_tests import ClinicTest
from rehab.sessions.formatting import format_rate
from rehab.sessions.questionnaires import Questionnaire
from rehab.sessions.setup.option import Group, Option
from rehab.sessions.setup.options import ANSWERS, OPTIONS, options_of, preset_options
from rehab.sessions.setup.presets import Preset, PresetOptionForm


@admin.register(Questionnaire)
class QuestionnaireAdmin(ScopedAdmin):
    """A clinic's own questions; those that GARRY brings are not changed."""

    list_display = ("name", "language", "source")
    search_fields = ("name", "items")


@admin.register(ClinicTest)
class ClinicTestAdmin(ScopedAdmin):
    """A clinic's own tests; one with results stays as it is, and is not deleted."""

    list_display = ("name", "code", "is_offered", "fixed_at")
    actions = None  # nothing is deleted without its own check

    def has_delete_permission(self, request: HttpRequest, obj: ClinicTest | None = None) -> bool:
        """Return whether nothing was measured by a test yet."""
        is_free = obj is None or obj.fixed_at is None
        return is_free and super().has_delete_permission(request, obj)


class PresetForm(ClinicForm):
    """A preset. The fields of its options come with `PresetAdmin.get_form`."""

    def __init__(self, *args: Any, **others: Any) -> None:
        super().__init__(*args, **others)
        self.initial = self.instance.values | self.initial

    def _post_clean(self) -> None:
        if not self.errors:  # else the preset would report the same once more
            self.instance.options = {name: self.cleaned_data[name] for name in self.instance.values}
            super()._post_clean()  # type: ignore[misc]  # Django's hook between form and model


class OptionFilter(admin.SimpleListFilter):
    """Filters a list of presets by an option that has few choices."""

    option: ClassVar[Option]

    def lookups(self, request: HttpRequest, model_admin: Any) -> Any:
        """Return the choices of the option."""
        return self.option.choices_for(None)

    def queryset(self, request: HttpRequest, queryset: QuerySet[Preset]) -> QuerySet[Preset]:
        """Return the presets with the chosen value."""
        chosen = self.value()
        return queryset.filter(**{f"options__{self.option.name}": chosen}) if chosen else queryset


def _filter_by(name: str) -> type[OptionFilter]:
    option = OPTIONS[name]
    return type(
        f"{name}_filter",
        (OptionFilter,),
        {"option": option, "title": option.label, "parameter_name": name},
    )


@admin.register(Preset)
class PresetAdmin(ScopedAdmin):
    """Presets, which the set-up offers as one tap."""

    form = PresetForm
    list_display = ("name", "summary", "wanted_hits", "protocol", "robot")
    list_filter = (_filter_by("valence"), _filter_by("robot"))
    list_select_related = ("protocol", "measure")
    search_fields = ("name", "protocol__name")

    def get_fieldsets(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the fields of the options; to those who only read, their values as text."""
        rows = ("name", "protocol", "measure")
        if not self.has_change_permission(request, obj):
            return [(None, {"fields": (*rows, "described")})]
        shown = {None: (Group.MAIN,), _("When page and robot answer"): ANSWERS}
        return [
            (
                title,
                {
                    "fields": (
                        *(rows if title is None else ()),
                        *(option.name for option in options_of(*groups)),
                    )
                },
            )
            for title, groups in shown.items()
        ]

    def get_form(
        self, request: HttpRequest, obj: Any = None, change: bool = False, **kwargs: Any
    ) -> Any:
        """Return the form with a field for each option."""
        fields = PresetOptionForm(by=user_of(request)).fields
        for option in preset_options():  # what js/shared/applies.js hides
            if option.applies_to:
                of, meant = option.applies_to
                fields[option.name].widget.attrs |= {"data-of": of, "data-is": " ".join(meant)}
        form = type(PresetForm.__name__, (PresetForm,), dict(fields))
        return super().get_form(request, obj, change, **kwargs, form=form)

    @admin.display(description=_("set-up"))
    def summary(self, preset: Preset) -> str:
        """Its feedback type, goal and duration."""
        return preset.summary

    @admin.display(description=_("target hit rate"))
    def wanted_hits(self, preset: Preset) -> str:
        """The wanted share of hits."""
        percent = preset.values["wanted_hits"]
        return format_rate(percent / 100) if percent else ""

    @admin.display(description=_("robot"))
    def robot(self, preset: Preset) -> str:
        """How lively the robot is."""
        return OPTIONS["robot"].describe(preset.values["robot"])

    @admin.display(description=_("options"))
    def described(self, preset: Preset) -> str:
        """Its options as text, a line each."""
        return "\n".join(
            f"{option.label}: {option.describe(preset.values[option.name])}"
            for option in preset_options()
        )
