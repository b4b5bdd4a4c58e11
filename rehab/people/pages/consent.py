"""Pages for a patient's consents and for the consent text."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import override
from django.views.decorators.http import require_http_methods

from rehab.people.access import clinic_of, for_roles, get_patient, user_of
from rehab.people.consent.forms import ConsentTextForm
from rehab.people.consent.models import Consent, Purpose
from rehab.people.consent.services import (
    MEANINGS,
    TOTALS_ONLY,
    active_consents,
    answered_purposes,
    current_text,
    is_care_allowed,
    list_answers,
    offered_purposes,
    publish_text,
    record_answer,
    split_paragraphs,
)
from rehab.people.models import BoardsConsent, Clinic, Patient
from rehab.people.roles import Role


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def show_consent(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Show a patient's consents; a POST records the answer to one of them."""
    user = user_of(request)
    patient = get_patient(user, patient_id)
    if request.method == "POST" and patient.erased_at is None:
        purpose, answer = request.POST.get("purpose", ""), request.POST.get("answer", "")
        is_asked = purpose in _listed_purposes(patient)
        if is_asked and answer in dict(list_answers(Purpose(purpose), is_across=True)):
            record_answer(patient, Purpose(purpose), answer, user, timezone.now())
        else:
            messages.error(request, _("That cannot be chosen. Tap one of the answers."))
        return redirect("consent", patient_id=patient.pk)
    rows = Consent.objects.visible_to(user).filter(patient=patient)
    text = current_text(patient.clinic)
    before, words, after = split_words(text.text, patient)
    context = {
        "patient": patient,
        "text": text,
        "before": before,
        "choices": [one | {"words": words.get(one["purpose"])} for one in list_choices(patient)],
        "after": after,
        "totals_only": TOTALS_ONLY,
        "history": rows.select_related("text", "recorded_by", "withdrawn_by"),
    }
    return render(request, "people/consent.html", context)


def split_words(text: str, patient: Patient) -> tuple[str, dict[Purpose, str], str]:
    """Return a text's words before those of the first purpose, of each purpose, and the others.

    A purpose's own paragraph begins with its name in the clinic's language and a colon; what
    follows it up to the next purpose's belongs to it.
    """
    names = _names_of(_listed_purposes(patient), patient.clinic)
    before: list[str] = []
    after: list[str] = []
    words: dict[Purpose, str] = {}
    for paragraph in split_paragraphs(text):
        name, _colon, said = paragraph.partition(":")
        if purpose := names.pop(name.strip(), None):
            if after:  # the purpose before goes on in these
                words[next(reversed(words))] += "\n\n" + "\n\n".join(after)
                after = []
            words[purpose] = said.strip()
        else:
            (after if words else before).append(paragraph)
    return "\n\n".join(before), words, "\n\n".join(after)


def _names_of(purposes: Iterable[Purpose], clinic: Clinic) -> dict[str, Purpose]:
    """Return purposes by their names in the clinic's language."""
    with override(clinic.language):
        return {str(purpose.label): purpose for purpose in purposes}


def list_choices(patient: Patient) -> list[dict[str, Any]]:
    """Return the purposes that are offered, or consented to, each with its options.

    An option is a value, its label, and whether it was answered: none, where nobody asked.
    """
    active, text = active_consents(patient), current_text(patient.clinic)
    answered = answered_purposes(patient)
    choices = []
    for purpose in _listed_purposes(patient):
        consent = active.get(purpose)
        is_refused = consent is None and purpose in answered
        if purpose == Purpose.BOARDS:
            now = patient.boards if consent else BoardsConsent.OWN
            across = patient.clinic.boards_across or now == BoardsConsent.ACROSS
        else:
            now, across = "yes" if consent else "no", False
        is_answered = consent is not None or is_refused
        options = [
            (value, label, value == now and is_answered)
            for value, label in list_answers(purpose, across)
        ]
        choices.append(
            {
                "purpose": purpose,
                "meaning": MEANINGS[purpose],
                "consent": consent,
                "is_answered": purpose in answered,
                "is_outdated": consent is not None and consent.text_id != text.pk,
                "options": options,
                # Without it no session can be set up.
                "is_missing": purpose == Purpose.CARE and not is_care_allowed(patient),
            }
        )
    return choices


def _listed_purposes(patient: Patient) -> list[Purpose]:
    """Return what the clinic asks for, and what the patient consents to."""
    listed = {*offered_purposes(patient.clinic), *active_consents(patient)}
    return [purpose for purpose in Purpose if purpose in listed]


@for_roles(Role.LEAD, patients=False)
@require_http_methods(["GET", "HEAD", "POST"])
def edit_consent_text(request: HttpRequest) -> HttpResponse:
    """Let a lead publish a new version of the text. Older versions stay as they are."""
    user = user_of(request)
    clinic = clinic_of(user)
    text = current_text(clinic)
    form = ConsentTextForm(
        request.POST or None,
        initial={"text": text.text},
        label_suffix="",
        purposes=_names_of(offered_purposes(clinic), clinic),
    )
    if request.method == "POST" and form.is_valid():
        new = publish_text(clinic, form.cleaned_data["text"], user, timezone.now())
        message = _("Version %(version)d is in force. Ask patients again when they come.")
        messages.success(request, message % {"version": new.version})
        return redirect("consent-text")
    return render(request, "people/consent_text.html", {"form": form, "text": text})
