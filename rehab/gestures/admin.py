"""Admin of gestures: a form of steps, with a drawing of their path or their errors."""

from __future__ import annotations

import json
from typing import Any

from django import forms
from django.contrib import admin
from django.core.exceptions import PermissionDenied, ValidationError
from django.http import HttpRequest, JsonResponse
from django.urls import path
from django.utils.formats import number_format
from django.utils.text import capfirst, slugify
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.gestures.models import ComposedGesture, GestureStep
from rehab.gestures.tracks import read_tracks
from rehab.people.web.admin_base import ScopedAdmin, ScopedOptions
from rehab.people.web.refusals import format_refusal
from rehab.people.web.row_forms import ClinicForm, LabeledFormSet
from robot.motion.composed_gestures import MAX_MOVES, NAME, to_data
from robot.motion.dry_run import DryRun, dry_run, validate_gesture
from robot.motion.gesture_errors import BadGesture
from robot.motion.gestures import GESTURES, ORIGINALS
from robot.motion.limits import REACH_M, TETHER_M
from robot.motion.preview import preview

TEXT_MAX = 4000  # characters of a preview's steps, lights or notes
STEP_FIELDS = ("turn_deg", "forward_m", "hold_s", "pace", "within_s")
WINDOW_S = 5.0  # of the robot's decisions; a longer gesture still runs at the next one


class GestureForm(ClinicForm):
    """A gesture, under a name as people write it: it becomes `slow-wave`."""

    name = forms.CharField(
        label=capfirst(_("name")), max_length=32, help_text=_("A word or two, such as slow wave.")
    )

    def clean_name(self) -> str:
        """Return the name as robots know it. Refuses one without a letter or digit."""
        name = str(self.cleaned_data["name"]).strip()
        if not NAME.fullmatch(name):
            name = slugify(name)
        if not name:
            raise ValidationError(gettext("Give a name with letters or digits."))
        return name


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


def show_steps(data: str, lights: str, notes: str) -> dict[str, Any]:
    """Return what a gesture with these steps (JSON) and tracks would do, or what is wrong."""
    try:
        steps = [
            GestureStep(**{name: step[name] for name in STEP_FIELDS}) for step in json.loads(data)
        ]
        moves = to_data("composed", [step.to_move() for step in steps])
        gesture = validate_gesture(moves | read_tracks(lights, notes))
    except BadGesture as problem:
        return {"problem": format_refusal(problem)}
    except ValidationError as problem:
        return {"problem": " ".join(problem.messages)}
    except (AttributeError, KeyError, TypeError, ValueError):
        return {"problem": gettext("Each step has numbers.")}
    return {"preview": preview(gesture), "words": describe_dry_run(dry_run(gesture))}


def describe_dry_run(run: DryRun) -> str:
    """Return how long a gesture takes and how far it goes, in words."""
    words = gettext(
        "Takes %(took)s s, goes up to %(far)s m from home (tether %(tether)s m), ends at home."
    ) % {
        "took": number_format(round(run.took_s, 1), 1),
        "far": number_format(round(run.farthest_m, 2), 2),
        "tether": number_format(TETHER_M, 2),
    }
    if run.took_s > WINDOW_S:
        words += " " + gettext("Longer than a window: it may miss the next.")
    return words


@admin.register(ComposedGesture)
class GestureAdmin(ScopedAdmin):
    """Gestures of the clinic."""

    list_display = ("name", "simulated")
    search_fields = ("name",)
    form = GestureForm
    fieldsets = (
        (None, {"fields": ("name",)}),
        (_("Lights and sound"), {"fields": ("lights", "notes"), "classes": ("collapse",)}),
    )
    inlines = (StepInline,)
    change_form_template = "gestures/admin_form.html"
    change_list_template = "gestures/admin_list.html"

    def get_urls(self) -> list[Any]:
        """Add the address of the floor's preview."""
        shown = path(
            "preview/",
            self.admin_site.admin_view(self.preview),
            name="rehab_composedgesture_preview",
        )
        return [shown, *super().get_urls()]

    def preview(self, request: HttpRequest) -> JsonResponse:
        """Answer what the steps of a form would do."""
        if not self.has_view_permission(request):
            raise PermissionDenied
        given = (request.GET.get(name, "")[:TEXT_MAX] for name in ("steps", "lights", "notes"))
        return JsonResponse(show_steps(*given))

    def changeform_view(
        self,
        request: HttpRequest,
        object_id: str | None = None,
        form_url: str = "",
        extra_context: dict[str, Any] | None = None,
    ) -> Any:
        """Tell the floor how far a robot may go, and in how many steps."""
        extra = {"reach_m": REACH_M, "most_steps": MAX_MOVES} | (extra_context or {})
        return super().changeform_view(request, object_id, form_url, extra)

    def changelist_view(
        self, request: HttpRequest, extra_context: dict[str, Any] | None = None
    ) -> Any:
        """Show the gestures that every robot knows below those of the clinic."""
        known = [*GESTURES.values(), *ORIGINALS.values()]
        shown = [
            {
                "label": _(gesture.label),
                "preview": json.dumps(preview(gesture)),
                "words": describe_dry_run(dry_run(gesture)),
            }
            for gesture in known
        ]
        return super().changelist_view(request, {"built_in": shown} | (extra_context or {}))

    @admin.display(description=_("simulated"))
    def simulated(self, gesture: ComposedGesture) -> str:
        """Return how long it takes and how far it goes, or what is wrong with it."""
        try:
            return describe_dry_run(dry_run(validate_gesture(gesture.to_data())))
        except BadGesture as problem:
            return format_refusal(problem)
