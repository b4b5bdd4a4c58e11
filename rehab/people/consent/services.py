"""Recording and withdrawing consent, the text it refers to, and what it allows."""

from __future__ import annotations

import re
from datetime import datetime
from typing import Any

from django.db import transaction
from django.db.models import Q
from django.dispatch import Signal
from django.utils.translation import gettext, override
from django.utils.translation import gettext_lazy as _

from rehab.people.consent.models import Consent, ConsentText, Purpose
from rehab.people.models import BoardsConsent, Clinic, Patient, User
from rehab.people.networks import is_outside

# Sent in the transaction of a withdrawal, with patient, purpose, by and now.
consent_withdrawn = Signal()


def split_paragraphs(text: str) -> list[str]:
    """Return a text's paragraphs, which lines without words part."""
    return re.split(r"\n\s*\n", text)


REMOTE_VIEW_TEXT = _(
    "Remote view: your therapist may watch a session from another place. Your care does not "
    "depend on it."
)
# The first text of a clinic, in its language. The clinic may change it.
DEFAULT_TEXT = (
    _(
        "GARRY measures your steps while you walk on the treadmill: how strongly you push off, "
        "when, and how your therapist set the goal. The clinic keeps this under a nickname and a "
        "number, never your full name."
    ),
    _("Care: your therapists use your sessions to plan your training."),
    _(
        "Research: researchers of this clinic see your sessions under a made-up name. They never "
        "see your nickname or number."
    ),
    _(
        "Boards: your results stand beside those of others, under the name of an animal. You can "
        "leave at any time, also by yourself on the tablet."
    ),
    REMOTE_VIEW_TEXT,
    _(
        "Family view: people whom you choose see on a page of their own, until the link ends, on "
        "which days you walked and for how many minutes, how many steps reached your goal, your "
        "points, how your last sessions compare with those before, and your next visit."
    ),
    _(
        "You may say no to any of these, and change your mind at any time. Your care does not "
        "depend on research, boards or family view."
    ),
)

# What a purpose means, in a sentence to the therapist.
MEANINGS = {
    Purpose.CARE: _("Sessions are kept, and therapists plan the training with them."),
    Purpose.RESEARCH: _("Researchers of the clinic see the sessions under a made-up name."),
    Purpose.BOARDS: _("Results stand beside those of others, under an animal's name."),
    Purpose.REMOTE: _("A therapist may watch a session from another place."),
    Purpose.FAMILY: _("People whom the patient chooses see how the training is going."),
}
TOTALS_ONLY = _("In totals only: the results count in sums of all, but have no row of their own.")
LEVELS = {
    BoardsConsent.CLINIC: _("Yes, in this clinic"),
    BoardsConsent.ACROSS: _("Yes, in all clinics"),
    BoardsConsent.TOTAL: _("Yes, in totals only"),
    BoardsConsent.OWN: _("No"),
}


def _is_included(clinic: Clinic, paragraph: Any) -> bool:
    return paragraph is not REMOTE_VIEW_TEXT or Purpose.REMOTE in offered_purposes(clinic)


def current_text(clinic: Clinic) -> ConsentText:
    """Return the current version of the text; create a clinic's first one on first use."""
    text = ConsentText.everywhere.filter(clinic=clinic).first()
    if text is None:
        with override(clinic.language):
            default = "\n\n".join(str(part) for part in DEFAULT_TEXT if _is_included(clinic, part))
        text, _created = ConsentText.everywhere.get_or_create(
            clinic=clinic, version=1, defaults={"text": default}
        )
    return text


def publish_text(clinic: Clinic, text: str, by: User | None, now: datetime) -> ConsentText:
    """Publish a text as a new version unless it is the current one. Earlier consents stay valid."""
    with transaction.atomic():
        Clinic.everywhere.select_for_update().get(pk=clinic.pk)
        current = current_text(clinic)
        if current.text == text:
            return current
        return ConsentText.everywhere.create(
            clinic=clinic, version=current.version + 1, text=text, written_by=by, written_at=now
        )


def active_consents(patient: Patient) -> dict[str, Consent]:
    """Return the consents of a patient that are not withdrawn, by purpose."""
    rows = Consent.everywhere.filter(patient=patient, withdrawn_at=None).select_related("text")
    return {row.purpose: row for row in rows}


def answered_purposes(patient: Patient) -> set[str]:
    """Return what a patient has said yes or no to; what nobody asked counts as no."""
    return set(Consent.everywhere.filter(patient=patient).values_list("purpose", flat=True))


def offered_purposes(clinic: Clinic) -> list[Purpose]:
    """Return what a clinic asks for: remote view only where it has named its own networks."""
    return [purpose for purpose in Purpose if clinic.networks or purpose is not Purpose.REMOTE]


def unasked_purposes(patient: Patient) -> list[Purpose]:
    """Return what a clinic asks for and a patient has answered neither way."""
    answered = answered_purposes(patient)
    return [purpose for purpose in offered_purposes(patient.clinic) if purpose not in answered]


def is_remote_view_allowed(patient: Patient, address: str) -> bool:
    """Return whether a person at this address may watch; outside the clinic it needs consent."""
    if patient.simulated or not is_outside(patient.clinic.networks, address):
        return True
    return Purpose.REMOTE in active_consents(patient)


def allows_remote_view(patient: str) -> Q:
    """Return the condition that the patient at a lookup may be watched from anywhere."""
    agreed = Consent.everywhere.filter(purpose=Purpose.REMOTE, withdrawn_at=None)
    return Q(**{f"{patient}__simulated": True}) | Q(**{f"{patient}__in": agreed.values("patient")})


def is_care_allowed(patient: Patient) -> bool:
    """Return whether sessions may be set up; a clinic may require the patient's consent."""
    is_required = patient.clinic.care_needs_consent and not patient.simulated
    return not is_required or Purpose.CARE in active_consents(patient)


def record_consent(
    patient: Patient, purpose: Purpose, by: User | None, now: datetime, level: str = ""
) -> None:
    """Record that a patient consents, to the current text.

    A consent to an older text or another ``level`` of boards is replaced; nothing is recorded for
    an erased patient.
    """
    with transaction.atomic():
        patient.lock()
        if patient.erased_at is not None:
            return
        text = current_text(patient.clinic)
        active = Consent.everywhere.filter(patient=patient, purpose=purpose, withdrawn_at=None)
        if active.filter(text=text, level=level).exists():
            return
        active.update(withdrawn_at=now, withdrawn_by=by)  # replaced below
        Consent.everywhere.create(
            patient=patient,
            purpose=purpose,
            level=level,
            text=text,
            given_at=now,
            recorded_by=by,
        )


def withdraw_consent(patient: Patient, purpose: Purpose, by: User | None, now: datetime) -> None:
    """Record that a patient withdraws a consent. Boards lose the patient's rows at once."""
    with transaction.atomic():
        patient.lock()
        Consent.everywhere.filter(patient=patient, purpose=purpose, withdrawn_at=None).update(
            withdrawn_at=now, withdrawn_by=by
        )
        if purpose == Purpose.BOARDS and patient.boards != BoardsConsent.OWN:
            patient.boards = BoardsConsent.OWN
            patient.save(update_fields=["boards"])
        consent_withdrawn.send(Consent, patient=patient, purpose=purpose, by=by, now=now)


def record_refusal(patient: Patient, purpose: Purpose, by: User | None, now: datetime) -> None:
    """Record that a patient says no: a consent ends; who never answered is noted as asked."""
    with transaction.atomic():
        withdraw_consent(patient, purpose, by, now)
        if patient.erased_at is None and purpose not in answered_purposes(patient):
            Consent.everywhere.create(
                patient=patient,
                purpose=purpose,
                text=current_text(patient.clinic),
                given_at=now,
                recorded_by=by,
                withdrawn_at=now,
                withdrawn_by=by,
            )


def list_answers(purpose: Purpose, is_across: bool) -> list[tuple[str, str]]:
    """Return the answers to a purpose, each a value and its label; ``is_across``: all clinics'."""
    if purpose != Purpose.BOARDS:
        return [("yes", gettext("Yes")), ("no", gettext("No"))]
    return [
        (level.value, str(label))
        for level, label in LEVELS.items()
        if is_across or level != BoardsConsent.ACROSS
    ]


def record_answer(
    patient: Patient, purpose: Purpose, answer: str, by: User | None, now: datetime
) -> None:
    """Record one of the answers to a purpose."""
    if purpose == Purpose.BOARDS:
        record_boards_consent(patient, BoardsConsent(answer), by, now)
    elif answer == "yes":
        record_consent(patient, purpose, by, now)
    else:
        record_refusal(patient, purpose, by, now)


def record_boards_consent(
    patient: Patient, boards: BoardsConsent, by: User | None, now: datetime
) -> None:
    """Record on which boards a patient consents to stand; OWN is a refusal."""
    if boards == BoardsConsent.OWN:
        record_refusal(patient, Purpose.BOARDS, by, now)
        return
    with transaction.atomic():
        record_consent(patient, Purpose.BOARDS, by, now, boards.value)
        if patient.erased_at is None:
            patient.boards = boards
            patient.save(update_fields=["boards"])
