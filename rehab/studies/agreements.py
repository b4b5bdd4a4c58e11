"""Who consented to a study, to which version of it, and walked under which."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date, datetime
from typing import Any

from django.db.models import F
from django.utils.translation import gettext

from rehab.people.consent.models import Consent, Purpose
from rehab.people.models import Patient, User
from rehab.sessions.formatting import clinic_time
from rehab.studies.models import Study, StudyVersion
from rehab.studies.participants import Enrollment, StudyEvent
from rehab.studies.registration.lifecycle import note
from rehab.training.measures import InvalidSetting

WITHDRAWN = "consent withdrawn"  # of an event: not only left, but took the consent back


@dataclass(frozen=True, slots=True)
class StudyConsent:
    """A consent to a study, signed on paper: to which version of its information, on which day."""

    version: str
    day: date


def check_consent(
    study: Study, patient: Patient, consent: StudyConsent | None, now: datetime
) -> None:
    """Raise InvalidSetting without a consent to the study, and for one of a day to come."""
    if consent is None or not consent.version.strip():
        if not patient.simulated:
            raise InvalidSetting(
                gettext(
                    "Nobody is enrolled without a consent to this very study: give its version "
                    "and the day on which %(patient)s signed it."
                )
                % {"patient": patient.nickname}
            )
    elif consent.day > clinic_time(now, study.clinic).date():
        raise InvalidSetting(gettext("The consent is dated later than today. Check its day."))


def agreed_version(enrollment: Enrollment) -> int:
    """Return the number of the version that a participant agreed to last."""
    events = enrollment.events.filter(kind=StudyEvent.Kind.CONSENTED)
    numbers = (int(about.rpartition(" ")[2]) for about in events.values_list("about", flat=True))
    return max((enrollment.version.number, *numbers))


def version_to_agree_to(enrollment: Enrollment) -> StudyVersion | None:
    """Return the latest version that a participant still has to agree to; None without one."""
    asked = enrollment.study.versions.filter(needs_consent=True)
    return asked.filter(number__gt=agreed_version(enrollment)).last()


def agree(enrollment: Enrollment, by: User | None, now: datetime) -> None:
    """Record that a participant agreed to the version that asks for it.

    Parameters
    ----------
    enrollment
        The participant; who has nothing to agree to is left as is.
    by, now
        Who asked for the consent (None for a program), and when.
    """
    version = version_to_agree_to(enrollment)
    if version is not None:
        about = f"version {version.number}"
        kind = StudyEvent.Kind.CONSENTED
        note(enrollment.study, kind, by, now, enrollment=enrollment, about=about)


def check_agreed(enrollment: Enrollment) -> None:
    """Raise InvalidSetting for a participant who has to agree to a newer version first."""
    version = version_to_agree_to(enrollment)
    if version is not None:
        raise InvalidSetting(
            gettext(
                "Version %(number)d of the study changes what %(code)s agreed to. Explain it, and "
                "record the consent on the participant’s page first."
            )
            % {"number": version.number, "code": enrollment.code}
        )


def agreement_rows(study: Study) -> Iterator[dict[str, Any]]:
    """Yield one row for each participant: versions of consent text and study, and of each visit."""
    enrollments = study.enrollments.select_related("version", "patient").order_by("pk")
    events = study.events.filter(kind=StudyEvent.Kind.WITHDRAWN, about=WITHDRAWN)
    withdrawn = {e.enrollment_id: clinic_time(e.at, study.clinic).date() for e in events}
    for one in enrollments:
        consents = Consent.everywhere.filter(patient=one.patient, purpose=Purpose.RESEARCH)
        agreed = consents.exclude(withdrawn_at=F("given_at"))  # that is a refusal
        given = agreed.filter(given_at__lte=one.enrolled_at).select_related("text")
        consent = given.order_by("-given_at").first()
        walked = one.visits.filter(version__isnull=False).order_by("number", "attempt")
        yield {
            "participant": one.code,
            "consent_text_version": consent and consent.text and consent.text.version,
            "study_consent_version": one.consent_version or None,
            "study_consented_on": one.consented_on,
            "study_consent_withdrawn_on": withdrawn.get(one.pk),
            "enrolled_under_version": one.version.number,
            "agreed_to_version": agreed_version(one),
            "versions_of_visits": " ".join(
                f"{number}:{version}"
                for number, version in walked.values_list("number", "version__number")
            ),
        }
