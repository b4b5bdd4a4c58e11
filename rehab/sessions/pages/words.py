"""The words of one open session: edited for it alone, not for the clinic."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from django import forms
from django.contrib import messages
from django.core.exceptions import ValidationError
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _
from django.views.decorators.http import require_http_methods

from rehab.feedback.forms import POOL_MAX
from rehab.people.access import for_roles, user_of
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.people.web.refusals import format_refusal
from rehab.sessions.forms.names import refuse_names
from rehab.sessions.live.database.clinic_owners import OwnedElsewhere
from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import change_session
from rehab.training.changes import OPEN_STATES, ChangeKind
from rehab.training.feedback_bands import TEXT_MAX, bands_to_json
from rehab.training.measures import InvalidSetting
from rehab.training.valences import Valence


class WordsForm(forms.Form):
    """The words of each band of a feedback type."""

    def __init__(self, *args: Any, patient: Patient, valence: Valence, **options: Any) -> None:
        super().__init__(*args, **options)
        self.patient = patient
        self.valence = valence
        for number, band in enumerate(valence.bands):
            self.fields[f"words_{number}"] = forms.CharField(
                label=_("from %(percent)d %% of the goal")
                % {"percent": round(100 * band.from_performance)},
                help_text=_("One a line; they take turns."),
                max_length=POOL_MAX * TEXT_MAX,
                initial=band.words,
                required=False,
                widget=forms.Textarea(attrs={"rows": 4}),
            )

    def clean(self) -> dict[str, Any]:
        """Return the cleaned data. Refuses words that name the patient."""
        data: dict[str, Any] = super().clean() or {}
        for field, words in list(data.items()):
            try:
                refuse_names(words, self.patient)
            except ValidationError as problem:
                self.add_error(field, problem)
        return data

    def to_change(self) -> dict[str, Any]:
        """Return the value of the change that puts the words into force."""
        bands = [
            replace(band, words=self.cleaned_data[f"words_{number}"])
            for number, band in enumerate(self.valence.bands)
        ]
        return {"valence": self.valence.slug, "bands": bands_to_json(bands)}


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def edit_words(request: HttpRequest, session_id: int) -> HttpResponse:
    """Edit what an open session's patient reads, from the next step on; the clinic's words stay."""
    user = user_of(request)
    rows = TrainingSession.objects.visible_to(user).select_related("patient", "clinic")
    session = get_object_or_404(rows, pk=session_id)
    if session.state not in {state.value for state in OPEN_STATES}:
        messages.error(request, gettext("This session has ended: nobody reads its words any more."))
        return redirect("session", session_id=session.pk)
    valences = SessionAggregate.load(session).fold.valences
    # The type that the words were typed for; another one may be in force by now.
    valence = valences.known.get(request.POST.get("valence", ""), valences.current)
    form = WordsForm(request.POST or None, patient=session.patient, valence=valence)
    if request.method == "POST" and form.is_valid():
        try:
            change_session(session, ChangeKind.FEEDBACK_TEXT, form.to_change(), user)
        except InvalidSetting as problem:
            form.add_error(None, format_refusal(problem))
        except (NotStored, OwnedElsewhere) as problem:
            form.add_error(None, str(problem))
        else:
            return redirect("monitor", session_id=session.pk)
    return render(request, "sessions/words.html", {"session": session, "form": form})
