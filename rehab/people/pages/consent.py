"""What a patient agrees to, noted with taps; and the words that patients agree to."""

from __future__ import annotations

from dataclasses import dataclass

from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.http import require_http_methods

from rehab.people.access import clinic_of, for_roles, person
from rehab.people.consent.models import (
    Consent,
    Purpose,
    current_text,
    give,
    holding,
    join_boards,
    may_be_cared_for,
    offered,
    withdraw,
    write_text,
)
from rehab.people.forms import ConsentTextForm
from rehab.people.models import Boards, Patient
from rehab.people.roles import Role

MEANING = {
    Purpose.CARE: gettext_lazy("Sessions are kept, and therapists plan the training with them."),
    Purpose.RESEARCH: gettext_lazy(
        "Researchers of the clinic see the sessions under a false name."
    ),
    Purpose.BOARDS: gettext_lazy("Results stand beside those of others, under an animal's name."),
    Purpose.REMOTE: gettext_lazy("A therapist may watch a session from another place."),
}
LEVELS = {
    Boards.OWN: gettext_lazy("No"),
    Boards.TOTAL: gettext_lazy("Totals only"),
    Boards.CLINIC: gettext_lazy("This clinic"),
    Boards.ACROSS: gettext_lazy("All clinics"),
}


@dataclass(frozen=True)
class Choice:
    """A purpose on the page."""

    purpose: Purpose
    meaning: str
    held: Consent | None
    is_old: bool  # to words that have changed since
    options: list[tuple[str, str, bool]]  # what is sent, its words, whether it is so now
    lacks: bool  # without it no session is set up


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def show_consent(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Show what a patient agrees to, and note what is tapped."""
    user = person(request)
    patients = Patient.objects.visible_to(user).select_related("clinic")
    patient = get_object_or_404(patients, pk=patient_id)
    if request.method == "POST" and patient.erased_at is None:
        purpose, says = request.POST.get("purpose"), request.POST.get("says", "")
        if purpose == Purpose.BOARDS and says in Boards.values:
            join_boards(patient, Boards(says), user, timezone.now())
        elif purpose in (*offered(patient.clinic), *holding(patient)) and says in ("yes", "no"):
            act = give if says == "yes" else withdraw
            act(patient, Purpose(purpose), user, timezone.now())
        else:
            messages.error(request, _("That cannot be chosen. Tap one of the answers."))
        return redirect("consent", patient_id=patient.pk)
    rows = Consent.objects.visible_to(user).filter(patient=patient)
    context = {
        "patient": patient,
        "text": current_text(patient.clinic),
        "choices": list_choices(patient),
        "past": rows.select_related("text", "recorded_by", "withdrawn_by"),
    }
    return render(request, "people/consent.html", context)


def list_choices(patient: Patient) -> list[Choice]:
    """Give every purpose with what holds of it."""
    held, text = holding(patient), current_text(patient.clinic)
    choices = []
    asked = {*offered(patient.clinic), *map(Purpose, held)}
    for purpose in (one for one in Purpose if one in asked):
        row = held.get(purpose)
        if purpose == Purpose.BOARDS:
            now = patient.boards if row else Boards.OWN
            across = patient.clinic.boards_across or now == Boards.ACROSS
            levels = [level for level in Boards if across or level != Boards.ACROSS]
            options = [(level.value, str(LEVELS[level]), level == now) for level in levels]
        else:
            options = [("yes", _("Yes"), row is not None), ("no", _("No"), row is None)]
        is_old = row is not None and row.text_id != text.pk
        lacks = purpose == Purpose.CARE and not may_be_cared_for(patient)
        choices.append(Choice(purpose, str(MEANING[purpose]), row, is_old, options, lacks))
    return choices


@for_roles(Role.LEAD, patients=False)
@require_http_methods(["GET", "HEAD", "POST"])
def write_words(request: HttpRequest) -> HttpResponse:
    """Let a lead put new words in force. Those that somebody agreed to stay as they are."""
    user = person(request)
    clinic = clinic_of(user)
    text = current_text(clinic)
    form = ConsentTextForm(request.POST or None, initial={"text": text.text}, label_suffix="")
    if request.method == "POST" and form.is_valid():
        new = write_text(clinic, form.cleaned_data["text"], user, timezone.now())
        said = _("Version %(version)d is in force. Ask patients again when they come.")
        messages.success(request, said % {"version": new.version})
        return redirect("consent-text")
    return render(request, "people/consent_text.html", {"form": form, "text": text})
