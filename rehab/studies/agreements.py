"""Who agreed to which version of a study, and walked under which."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from typing import Any

from django.utils.translation import gettext

from rehab.people.consent.models import Consent, Purpose
from rehab.people.models import User
from rehab.studies.models import Study, StudyVersion
from rehab.studies.participants import Enrollment, StudyEvent
from rehab.studies.registration.lifecycle import note
from rehab.training.measures import InvalidSetting


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
    for one in enrollments:
        consents = Consent.everywhere.filter(patient=one.patient, purpose=Purpose.RESEARCH)
        given = consents.filter(given_at__lte=one.enrolled_at).select_related("text")
        consent = given.order_by("-given_at").first()
        walked = one.visits.filter(version__isnull=False).order_by("number", "attempt")
        yield {
            "participant": one.code,
            "consent_text_version": consent and consent.text and consent.text.version,
            "enrolled_under_version": one.version.number,
            "agreed_to_version": agreed_version(one),
            "versions_of_visits": " ".join(
                f"{number}:{version}"
                for number, version in walked.values_list("number", "version__number")
            ),
        }
