"""Which language a page has. This is the one place that says so.

Pages of people who work here have the account's own language or else the clinic's, a tablet's
have its clinic's, and a stranger's have the browser's. What a patient reads is in the patient's
language: its view says so with `speak_to`. Programs are answered in English.
"""

from __future__ import annotations

from collections.abc import Callable

from django.conf import settings
from django.http import HttpRequest, HttpResponseBase
from django.utils import timezone, translation
from django.utils.cache import patch_vary_headers

from rehab.people.access import tablet_of
from rehab.people.models import LANGUAGES, Patient, User
from rehab.people.sign_in import flow

FOR_PROGRAMS = "/api/"


def language_of(user: User) -> str:
    """Give the language of an account; "" where neither it nor its clinic says one."""
    return user.language or (user.clinic.language if user.clinic else "")


def chosen_language(request: HttpRequest) -> str:
    """Give the language that is known of whoever asks; "" for a stranger."""
    if request.path_info.startswith(FOR_PROGRAMS):
        return settings.LANGUAGE_CODE
    user = request.user
    person = user if isinstance(user, User) else flow.halfway(request, timezone.now())
    if person is not None:
        return language_of(person)
    tablet = tablet_of(request)
    return tablet.clinic.language if tablet is not None else ""


def speak_to(patient: Patient) -> None:
    """Answer this request in a patient's language."""
    translation.activate(patient.language)


class LanguageMiddleware:
    """Answers in the language of whoever asks. Sync and thread-safe: it keeps no state."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on; afterwards this thread speaks as it did before."""
        chosen = chosen_language(request)
        known = chosen in dict(LANGUAGES)
        language = chosen if known else translation.get_language_from_request(request)
        with translation.override(language):
            response = self.get_response(request)
            response.headers.setdefault("Content-Language", translation.get_language() or language)
        if not known:
            patch_vary_headers(response, ["Accept-Language"])
        return response
