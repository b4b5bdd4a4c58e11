"""Admin of presets and of a clinic's own questionnaires."""

from __future__ import annotations

from typing import Any

from django import forms
from django.contrib import admin
from django.http import HttpRequest
from django.utils.text import capfirst
from django.utils.translation import gettext_lazy as _

from rehab.people.access import user_of
from rehab.people.web.admin_base import ScopedAdmin
from rehab.sessions.questionnaires import Questionnaire
from rehab.sessions.setup.gestures import robot_gesture_choices
from rehab.sessions.setup.presets import Preset


@admin.register(Questionnaire)
class QuestionnaireAdmin(ScopedAdmin):
    """A clinic's own questions; those that GARRY brings are not changed."""

    list_display = ("name", "language", "source")
    search_fields = ("name", "items")


@admin.register(Preset)
class PresetAdmin(ScopedAdmin):
    """Presets, which the set-up offers as one tap."""

    list_display = ("name", "valence", "goal_label", "wanted_hits", "minutes", "protocol", "robot")
    list_filter = ("valence", "robot")
    list_select_related = ("protocol", "measure")
    search_fields = ("name", "protocol__name")
    radio_fields = {"valence": admin.HORIZONTAL, "goal_by": admin.HORIZONTAL}
    fieldsets = (
        (None, {"fields": ("name", "valence", "protocol")}),
        (
            _("Goal"),
            {
                "fields": (
                    ("measure", "goal_by"),
                    ("goal_value", "goal_percent"),
                    ("wanted_hits", "minutes"),
                )
            },
        ),
        (
            _("Feedback and goal"),
            {
                "fields": (
                    ("schedule", "schedule_steps", "schedule_band"),
                    ("goal_follows", "goal_asks"),
                )
            },
        ),
        (
            _("Robot and source"),
            {
                "fields": (
                    "robot",
                    ("robot_above", "robot_below"),
                    ("robot_threshold", "robot_answers"),
                    ("robot_window", "robot_count", "robot_rest"),
                    "source",
                )
            },
        ),
    )

    def formfield_for_dbfield(self, db_field: Any, request: HttpRequest, **kwargs: Any) -> Any:
        """Offer the gestures that this clinic has."""
        if db_field.name in {"robot_above", "robot_below"}:
            return forms.ChoiceField(
                choices=robot_gesture_choices(user_of(request)),
                label=capfirst(db_field.verbose_name),
            )
        return super().formfield_for_dbfield(db_field, request, **kwargs)

    @admin.display(description=_("goal"))
    def goal_label(self, preset: Preset) -> str:
        """The goal as text."""
        return preset.goal_label
