"""Admin of gestures: a form of steps, with a drawing of their path or their errors."""

from __future__ import annotations

from typing import Any

from django import forms
from django.contrib import admin
from django.core.exceptions import ValidationError
from django.http import HttpRequest
from django.utils.html import format_html
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.gestures.models import Gesture, GestureStep
from rehab.gestures.path_drawing import draw_path
from rehab.people.web.admin_base import LabeledFormSet, ScopedAdmin, ScopedOptions
from rehab.people.web.refusals import format_refusal
from robot.motion.dry_run import DryRun, dry_run, validate_gesture
from robot.motion.gesture import TETHER_M
from robot.motion.gesture_errors import BadGesture
from robot.motion.gesture_spec import MAX_MOVES, to_data

WINDOW_S = 5.0  # of the robot's decisions; a longer gesture still runs at the next one


class StepFormSet(LabeledFormSet):
    """The steps of one gesture, which must be valid together."""

    def clean(self) -> None:
        """Refuse steps that no robot plays."""
        super().clean()
        if any(self.errors):
            return
        kept: list[GestureStep] = []
        for form in self.forms:
            if form in self.deleted_forms or not (form.instance.pk or form.has_changed()):
                continue
            if form.instance.position is None:  # a row without a number follows the one above
                form.instance.position = 1 + max((step.position for step in kept), default=0)
            kept.append(form.instance)
        kept.sort(key=lambda step: step.position)
        try:
            validate_gesture(to_data("composed", [step.to_move() for step in kept]))
        except BadGesture as problem:
            raise ValidationError(format_refusal(problem)) from problem


class StepForm(forms.ModelForm):
    """One step, in narrow fields."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.fields["position"].required = False
        for name, field in self.fields.items():
            if name not in {"DELETE", "gesture"}:
                field.widget.attrs["class"] = "vIntegerField"


class StepInline(ScopedOptions, admin.TabularInline):
    """A gesture's steps on its page."""

    model = GestureStep
    form = StepForm
    formset = StepFormSet
    max_num = MAX_MOVES
    ordering = ("position",)

    def get_extra(self, request: HttpRequest, obj: Any = None, **options: Any) -> int:
        """Return the number of empty rows: 4 for a new gesture."""
        return 0 if obj else 4


def describe_dry_run(run: DryRun) -> str:
    """Return how long a gesture takes and how far it goes, in words."""
    words = gettext(
        "Takes %(took).1f s, goes up to %(far).2f m from home (tether %(tether).2f m), "
        "ends at home."
    ) % {"took": run.took_s, "far": run.farthest_m, "tether": TETHER_M}
    if run.took_s > WINDOW_S:
        words += " " + gettext("Longer than a window: it may miss the next.")
    return words


@admin.register(Gesture)
class GestureAdmin(ScopedAdmin):
    """Gestures of the clinic."""

    list_display = ("name", "simulated")
    search_fields = ("name",)
    fields = ("name", "picture")
    readonly_fields = ("picture",)
    inlines = (StepInline,)

    @admin.display(description=_("simulated"))
    def simulated(self, gesture: Gesture) -> str:
        """Return how long it takes and how far it goes, or what is wrong with it."""
        try:
            return describe_dry_run(dry_run(validate_gesture(gesture.to_data())))
        except BadGesture as problem:
            return format_refusal(problem)

    @admin.display(description=_("where it goes"))
    def picture(self, gesture: Gesture) -> str:
        """Return the drawing of the stored gesture's path, or why there is none."""
        if not gesture.pk:
            return gettext("Save it to see where it goes. Its last step has to end at home.")
        try:
            run = dry_run(validate_gesture(gesture.to_data()))
        except BadGesture as problem:
            return format_refusal(problem)
        words = describe_dry_run(run)
        return format_html("{}<p>{}</p>", draw_path(gesture.to_moves(), run, words), words)
