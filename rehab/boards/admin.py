"""Admin of leaderboards: a form with a preview of the board as a patient would see it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from django import forms
from django.contrib import admin
from django.db.models import Max, Q, QuerySet
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.boards.choices import Aggregation, Occasion, Participants
from rehab.boards.models import Leaderboard
from rehab.boards.panels.panel_rows import with_example
from rehab.boards.panels.shared_panels import BoardViewer
from rehab.people.access import user_of
from rehab.people.models import BoardsConsent, Patient
from rehab.people.models.hidden_patients import hidden_patients
from rehab.people.roles import Role
from rehab.people.row_values import read_key
from rehab.people.web.admin_preview import PreviewAdmin, iter_form_errors
from rehab.people.web.row_forms import ClinicForm
from rehab.sessions.models import TrainingSession
from rehab.training.changes import State
from rehab.training.valences import VALENCES

MAX_SEEN_AS = 60  # patients that the preview offers as viewers, the latest to walk first
MAX_GROUP = 1_000  # the preview's URL contains each key; servers refuse URLs beyond 16 kB


class LeaderboardForm(ClinicForm):
    """All settings of a board on one page; the defaults are safe ones."""

    valences = forms.MultipleChoiceField(
        label=_("Which types"),
        choices=[(valence.slug, _(valence.label)) for valence in VALENCES.values()],
        widget=forms.CheckboxSelectMultiple,
        required=False,
    )

    def clean(self) -> dict[str, Any]:
        """Refuse a group that is too small ever to be shown, or too large to be sent."""
        cleaned: dict[str, Any] = super().clean() or self.cleaned_data
        group = cleaned.get("group")
        if group is not None:
            self.instance.chosen = [patient.pk for patient in group]
        fewest = cleaned.get("min_participants") or 0
        if cleaned.get("among") == Participants.GROUP and len(group or []) < fewest:
            few = _("Choose at least %(fewest)d patients.") % {"fewest": fewest}
            self.add_error("group", few)
        elif len(group or []) > MAX_GROUP:
            many = _("Choose at most %(most)d patients, or all of the clinic.")
            self.add_error("group", many % {"most": MAX_GROUP})
        return cleaned


@admin.register(Leaderboard)
class LeaderboardAdmin(PreviewAdmin):
    """Leaderboards of the clinic."""

    form = LeaderboardForm
    change_form_template = "boards/admin_form.html"
    list_display = ("name", "among", "types", "metric", "period", "occasion", "active")
    list_filter = ("active", "occasion", "among", "metric")
    search_fields = ("name",)
    radio_fields = dict.fromkeys(
        ("among", "types", "aggregation", "period", "occasion", "display", "names", "ties"),
        admin.HORIZONTAL,
    )
    fieldsets = (
        (
            _("Who and what"),
            {
                "fields": (
                    *("name", "among", "group", "metric", "aggregation", "mean_of"),
                    *("types", "valences"),
                )
            },
        ),
        (
            _("Which sessions"),
            {
                "fields": (
                    *("period", ("period_from", "period_to")),
                    *(("min_valid_strides", "min_minutes"), "include_simulated"),
                )
            },
        ),
        (
            _("How it is shown"),
            {
                "fields": (
                    *("occasion", "display", "top_n", "total_goal", "names"),
                    *("show_ranks", "min_participants", "active"),
                )
            },
        ),
        (
            _("Finer points"),
            {
                "classes": ("collapse",),
                "fields": ("ties", "tie_breaker", "higher_is_better", "frozen_on"),
            },
        ),
    )

    def formfield_for_choice_field(self, db_field: Any, request: HttpRequest, **kwargs: Any) -> Any:
        """Offer what this person may build: a host boards across clinics, others all the rest."""
        if db_field.name == "among":
            across = Participants.ACROSS
            hosts = user_of(request).role == Role.HOST
            kwargs["choices"] = [
                choice for choice in Participants.choices if (choice[0] == across) == hosts
            ]
        return super().formfield_for_choice_field(db_field, request, **kwargs)

    def formfield_for_manytomany(self, db_field: Any, request: HttpRequest, **kwargs: Any) -> Any:
        """Offer the patients of a group as checkboxes, without those who are erased."""
        kwargs["widget"] = forms.CheckboxSelectMultiple()
        field: Any = super().formfield_for_manytomany(db_field, request, **kwargs)
        field.queryset = field.queryset.filter(erased_at=None)
        return field

    def get_changeform_initial_data(self, request: HttpRequest) -> dict[str, Any]:
        """Return initial values that can be saved as they are."""
        if user_of(request).role == Role.HOST:
            return {"among": Participants.ACROSS, "aggregation": Aggregation.BEST}
        return {}

    def render_change_form(
        self, request: HttpRequest, context: dict[str, Any], *args: Any, **kwargs: Any
    ) -> HttpResponse:
        """Show the form, with the patients that the preview offers as viewers."""
        context["seen_as"] = self._patients_who_walked(request)[:MAX_SEEN_AS]
        return super().render_change_form(request, context, *args, **kwargs)

    def render_preview(self, request: HttpRequest, row: Leaderboard | None) -> HttpResponse:
        """Show the board, computed from the clinic's own sessions."""
        data = request.GET.copy()
        data["name"] = data.get("name", "").strip() or gettext("Leaderboard")
        form = self.get_form(request, row, change=row is not None)(data, instance=row)
        if not form.is_valid():
            errors = list(iter_form_errors(form))
            return render(request, "boards/preview_errors.html", {"errors": errors})
        if form.instance.clinic_id is None:
            error = gettext(
                "It is made of patients, whom a host does not see. Clinics see it on tablets."
            )
            return render(request, "boards/preview_errors.html", {"errors": [("", error)]})
        viewer = self._viewer(request, form.instance)
        board = viewer.make_panel()
        if not (form.instance.is_own or board.shared) and (why := viewer.explain_nothing()):
            board = replace(board, summary=f"{board.summary} {why}", nothing=board.nothing or why)
        return render(
            request,
            "boards/scores.html",
            {"boards": [with_example(form.instance, board)], "ranked": True},
        )

    def _viewer(self, request: HttpRequest, board: Leaderboard) -> BoardViewer:
        """Return the viewer of the preview: a patient after the newest session, or anybody."""
        now = timezone.now()
        anybody = BoardViewer(board, now)
        if board.occasion == Occasion.WAITING:
            return anybody
        finished = TrainingSession.objects.visible_to(request.user).filter(
            state=State.FINISHED.value
        )
        newest = finished.order_by("simulated", "-started_at")
        chosen = read_key(request.GET.get("seen_as", ""))
        walkers = self._patients_who_walked(request)
        if chosen:
            patient = walkers.filter(pk=chosen).first()
        else:  # a patient who sees the board itself, where there is one
            typical = replace(anybody, session=newest.first()).find_typical()
            patient = walkers.filter(pk=typical or 0).first() or walkers.first()
        session = newest.filter(patient=patient).first()
        return replace(anybody, patient=patient, session=session)

    def _patients_who_walked(self, request: HttpRequest) -> QuerySet[Patient]:
        """Return the patients who have walked, those who agreed to boards first.

        A preview shows their own sessions, so those are left out whose sessions a study hides.
        """
        user = user_of(request)
        walked = Patient.objects.visible_to(user).filter(sessions__state=State.FINISHED.value)
        walked = walked.exclude(pk__in=hidden_patients(user))
        return walked.annotate(
            alone=Q(boards=BoardsConsent.OWN), last_here=Max("sessions__started_at")
        ).order_by("alone", "-last_here")
