"""Which patient a health record has open, where GARRY is launched from it (SMART App Launch 2.2.0).

Who signs in is found as by the hospital's sign-on, which issues the record's tokens, too; the
patient by the identifier that is the clinic's code. Nobody is opened unless exactly one fits.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from authlib.integrations.base_client.errors import OAuthError
from django.conf import settings
from django.utils.translation import gettext as _
from requests import RequestException

from rehab.people.models import Patient, User
from rehab.people.roles import may_see_names
from rehab.people.sign_in import sign_on

FHIR_ID = re.compile(r"[A-Za-z0-9\-.]{1,64}")  # FHIR R4, 2.24.0.1
ENDED_USE = "old"  # of an identifier that is not the patient's any more


def is_launch(issuer: str) -> bool:
    """Return whether a launch is from the health record that this server knows."""
    return bool(settings.SMART_FHIR) and issuer.rstrip("/") == settings.SMART_FHIR


def find_patient(user: User, token: Mapping[str, Any]) -> Patient | None:
    """Return the patient of a person's clinic whom the record has open; None where there is none.

    Raises SignOnRefused where the record does not say who it is.
    """
    if not may_see_names(user.role):
        return None  # a code would tell whose pseudonym it is
    name = token.get("patient")
    try:
        if not (isinstance(name, str) and FHIR_ID.fullmatch(name)):
            raise OAuthError("no_patient")
        answer = sign_on.client("launch").get(
            f"{settings.SMART_FHIR}/Patient/{name}",
            token=token,
            headers={"Accept": "application/fhir+json"},
        )
        answer.raise_for_status()
        resource = answer.json()
        if (resource["resourceType"], resource["id"]) != ("Patient", name):
            raise OAuthError("other_patient")
        codes = [
            str(one["value"])
            for one in resource.get("identifier", ())
            if one.get("system") == settings.SMART_IDENTIFIER and one.get("use") != ENDED_USE
        ]
    except (OAuthError, RequestException, ValueError, LookupError, TypeError, AttributeError) as no:
        raise sign_on.SignOnRefused(
            _("The hospital’s record did not say which patient is open. Launch GARRY there again.")
        ) from no
    found = list(Patient.objects.visible_to(user).filter(code__in=codes)[:2])
    return found[0] if len(found) == 1 else None
