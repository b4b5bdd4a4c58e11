"""The language and the time zone of each page, decided here alone.

Pages for people who work here are in the account's own language, else the clinic's; a tablet's in
its clinic's; a stranger's in the browser's. Views that a patient reads call
`activate_patient_language`. Programs are answered in English.

Templates and the admin format times in the current time zone: that of the clinic of the person or
tablet. A host's pages are in the server's (GARRY_TIME_ZONE); programs get times with their offset.
"""

from __future__ import annotations

from collections.abc import Callable
from zoneinfo import ZoneInfo

from django.conf import settings
from django.http import HttpRequest, HttpResponseBase
from django.utils import timezone, translation
from django.utils.cache import patch_vary_headers

from rehab.people.access import tablet_of
from rehab.people.models import LANGUAGES, Patient, User
from rehab.people.sign_in import two_stage_sign_in

API_PREFIX = "/api/"


def language_of(user: User) -> str:
    """Return the language of an account; "" where neither it nor its clinic has one."""
    return user.language or (user.clinic.language if user.clinic else "")


def request_language(request: HttpRequest) -> str:
    """Return the language of the person, program or tablet of a request; "" for a stranger."""
    if request.path_info.startswith(API_PREFIX):
        return settings.LANGUAGE_CODE
    user = request.user
    person = (
        user
        if isinstance(user, User)
        else two_stage_sign_in.pending_second_factor(request, timezone.now())
    )
    if person is not None:
        return language_of(person)
    tablet = tablet_of(request)
    return tablet.clinic.language if tablet is not None else ""


def activate_patient_language(patient: Patient) -> None:
    """Answer this request in a patient's language."""
    translation.activate(patient.language)


class LanguageMiddleware:
    """Answers in the language of the request. Sync and thread-safe: it keeps no state."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on; then restore the language of this thread."""
        chosen = request_language(request)
        known = chosen in dict(LANGUAGES)
        language = chosen if known else translation.get_language_from_request(request)
        with translation.override(language):
            response = self.get_response(request)
            response.headers.setdefault("Content-Language", translation.get_language() or language)
        if not known:
            patch_vary_headers(response, ["Accept-Language"])
        return response


def request_time_zone(request: HttpRequest) -> ZoneInfo | None:
    """Return the time zone of the clinic of a request; None where there is none."""
    if request.path_info.startswith(API_PREFIX):
        return None
    user = request.user
    clinic = getattr(user if isinstance(user, User) else tablet_of(request), "clinic", None)
    return ZoneInfo(clinic.time_zone) if clinic else None


class LocalTimeMiddleware:
    """Formats times in the clinic's time zone. Sync and thread-safe: it keeps no state."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on; then restore the time zone of this thread."""
        with timezone.override(request_time_zone(request)):
            return self.get_response(request)
