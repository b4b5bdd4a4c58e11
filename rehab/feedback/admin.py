"""Admin of feedback types: a list of all four, and a form with a preview for each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from django import forms
from django.contrib import admin, messages
from django.core.exceptions import PermissionDenied
from django.db import transaction
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils.choices import flatten_choices
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, override

from rehab.feedback.clinic_valences import default_valence, valences_of
from rehab.feedback.forms import BandForm, BandFormSet, FeedbackTypeForm, word_fields
from rehab.feedback.models import FeedbackBand, FeedbackType, feedback_text_edited
from rehab.feedback.preview import preview_bands
from rehab.feedback.translation import SOURCE_LANGUAGE
from rehab.gestures.choices import gesture_choices
from rehab.people.access import clinic_of, user_of
from rehab.people.models import LANGUAGES
from rehab.people.web.admin_base import ScopedOptions
from rehab.people.web.admin_preview import PreviewAdmin, iter_form_errors
from rehab.training.feedback_bands import BANDS_MAX
from rehab.training.valences import VALENCES

READ_ONLY_FIELDS = ("from_percent", "words", "confetti")


class BandInline(ScopedOptions, admin.StackedInline):
    """A type's bands on its page, each with its words in one language below the other."""

    model = FeedbackBand
    form = BandForm
    formset = BandFormSet
    fields = (("from_percent", "confetti"), *word_fields())
    ordering = ("from_percent",)
    max_num = BANDS_MAX

    def get_extra(self, request: HttpRequest, obj: Any = None, **options: Any) -> int:
        """Return the number of default bands for a type that has none of its own yet."""
        default = None if obj and obj.pk else VALENCES.get(request.GET.get("slug", ""))
        return len(default.bands) if default else 0

    def get_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return a field for each language, or all words together to those who only read."""
        return self.fields if self.has_change_permission(request) else READ_ONLY_FIELDS


@admin.register(FeedbackType)
class FeedbackTypeAdmin(PreviewAdmin):
    """Feedback types of the clinic."""

    form = FeedbackTypeForm
    change_list_template = "feedback/admin_list.html"
    change_form_template = "feedback/admin_form.html"
    delete_confirmation_template = "feedback/admin_reset.html"
    inlines = (BandInline,)
    fields = ("slug", "hit_points", "miss_points", "cue_above", "cue_below")

    def get_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the fields that this type uses."""
        slug = obj.slug if obj and obj.pk else request.GET.get("slug") or request.POST.get("slug")
        form = FeedbackTypeForm(initial={"slug": slug})
        return [name for name in self.fields if name in form.fields]

    def formfield_for_dbfield(self, db_field: Any, request: HttpRequest, **kwargs: Any) -> Any:
        """Offer the gestures of this person's clinic."""
        if db_field.name in ("cue_above", "cue_below"):
            choices = [("", gettext_lazy("Nothing")), *gesture_choices(user_of(request))]
            label = db_field.verbose_name.capitalize()
            words = _("When the mean of five seconds reaches the robot’s threshold.")
            if db_field.name == "cue_below":
                words = _("When the mean of five seconds stays below that threshold.")
            return forms.ChoiceField(label=label, choices=choices, required=False, help_text=words)
        return super().formfield_for_dbfield(db_field, request, **kwargs)

    def get_changeform_initial_data(self, request: HttpRequest) -> dict[str, Any]:
        """Return the defaults of the type that is edited for the first time."""
        default = VALENCES.get(request.GET.get("slug", ""))
        if default is None:
            return {}
        return {
            "slug": default.slug,
            "hit_points": default.hit_points,
            "miss_points": default.miss_points,
            "cue_above": default.cue.above or "",
            "cue_below": default.cue.below or "",
        }

    def get_formset_kwargs(
        self, request: HttpRequest, obj: Any, inline: Any, prefix: str
    ) -> dict[str, Any]:
        """Return the default bands as initial values."""
        kwargs: dict[str, Any] = super().get_formset_kwargs(request, obj, inline, prefix)
        slug = request.GET.get("slug", "")
        if request.method == "GET" and obj.pk is None and slug in VALENCES:
            kwargs["initial"] = initial_bands(slug)
        return kwargs

    def changelist_view(
        self, request: HttpRequest, extra_context: dict[str, Any] | None = None
    ) -> HttpResponse:
        """Show all types, those that the clinic edited and those with the defaults."""
        if not self.has_view_permission(request):
            raise PermissionDenied
        clinic = clinic_of(user_of(request))
        rows = {row.slug: row for row in self.get_queryset(request)}
        add = reverse("admin:rehab_feedbacktype_add")
        gestures = dict(flatten_choices(gesture_choices(user_of(request))))
        types = [
            {
                "valence": valence,
                "own": slug in rows,
                "above": gestures.get(valence.cue.above, valence.cue.above),
                "below": gestures.get(valence.cue.below, valence.cue.below),
                "url": reverse("admin:rehab_feedbacktype_change", args=[rows[slug].pk])
                if slug in rows
                else f"{add}?slug={slug}",
            }
            for slug, valence in valences_of(clinic.pk, clinic.language).items()
        ]
        context = {
            **self.admin_site.each_context(request),
            "title": _("Feedback types"),
            "opts": self.opts,
            "types": types,
            "may_add": self.has_add_permission(request),
        }
        return render(request, self.change_list_template, context | (extra_context or {}))

    def add_view(
        self, request: HttpRequest, form_url: str = "", extra_context: Any = None
    ) -> HttpResponse:
        """Edit the defaults of a type; redirect to the row of one that was edited before."""
        slug = request.GET.get("slug") or request.POST.get("slug")
        if slug not in VALENCES:
            return self.changelist_view(request)
        own = self.get_queryset(request).filter(slug=slug).first()
        if own is not None and request.method == "GET":
            return redirect("admin:rehab_feedbacktype_change", own.pk)
        context = {"title": _("Edit the feedback type"), **(extra_context or {})}
        response: HttpResponse = super().add_view(request, form_url, context)
        return response

    def render_change_form(
        self, request: HttpRequest, context: dict[str, Any], *args: Any, **kwargs: Any
    ) -> HttpResponse:
        """Show the form, with the type's name and the languages of the preview."""
        obj = kwargs.get("obj")
        slug = obj.slug if obj else request.GET.get("slug") or request.POST.get("slug")
        context["default"] = VALENCES.get(str(slug))
        context["languages"] = LANGUAGES
        context["show_save_and_add_another"] = False
        return super().render_change_form(request, context, *args, **kwargs)

    def save_related(self, request: HttpRequest, form: Any, formsets: Any, change: bool) -> None:
        """Store the bands, then send the words to the open sessions."""
        super().save_related(request, form, formsets, change)
        row = form.instance
        self._announce(request, row, row.clinic_id, row.slug)

    def delete_model(self, request: HttpRequest, obj: FeedbackType) -> None:
        """Go back to the defaults, in open sessions as well."""
        clinic_id, slug = obj.clinic_id, obj.slug
        super().delete_model(request, obj)
        self._announce(request, None, clinic_id, slug)

    def _announce(
        self, request: HttpRequest, row: FeedbackType | None, clinic_id: int, slug: str
    ) -> None:
        """Send the signal of edited words once they are stored."""

        def announce() -> None:
            responses = feedback_text_edited.send(
                FeedbackType, row=row, clinic_id=clinic_id, slug=slug, by=user_of(request)
            )
            for _receiver, problems in responses:
                for problem in problems or ():
                    messages.warning(request, problem)

        transaction.on_commit(announce)

    def render_preview(self, request: HttpRequest, row: FeedbackType | None) -> HttpResponse:
        """Show what a patient would see in each band."""
        data = request.GET
        language = data.get("seen_in", "")
        if language not in dict(LANGUAGES):
            language = clinic_of(user_of(request)).language
        form = self.get_form(request, row, change=row is not None)(data, instance=row)
        inline = self.get_inline_instances(request, row)[0]
        rows: Any = inline.get_formset(request, row)
        context: dict[str, Any] = {"language": language, "errors": []}
        is_valid = form.is_valid()
        bands = rows(data, instance=form.instance, prefix="bands")
        if is_valid and bands.is_valid():
            context["valence"] = form.instance.to_valence(language, bands.bands(language))
            context["seen"] = list(preview_bands(context["valence"]))
        else:
            context["errors"] = [*iter_form_errors(form), *iter_band_errors(form, bands)]
        with override(language):
            return render(request, "feedback/preview.html", context)


def initial_bands(slug: str) -> list[dict[str, Any]]:
    """Return the default bands of a type as initial values, in each language that has them."""
    translated = {language: default_valence(slug, language) for language in word_fields().values()}
    return [
        {
            "from_percent": round(100 * band.from_performance),
            "confetti": band.confetti.value,
            **{
                name: translated[language].bands[index].words
                for name, language in word_fields().items()
                if language == SOURCE_LANGUAGE
                or translated[language].bands[index].words != band.words
            },
        }
        for index, band in enumerate(VALENCES[slug].bands)
    ]


def iter_band_errors(form: Any, bands: Any) -> Iterator[tuple[str, str]]:
    """Yield the errors of the bands, unless the form of their type has errors itself."""
    if not form.errors:
        for row in bands.forms:
            yield from iter_form_errors(row)
        yield from (("", problem) for problem in bands.non_form_errors())
