"""The catalog of the scripts' translations, and the language of the own account."""

from __future__ import annotations

from django.contrib import messages
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import redirect
from django.utils import translation
from django.utils.translation import gettext as _
from django.views.decorators.cache import cache_control
from django.views.decorators.http import conditional_page, require_POST, require_safe
from django.views.i18n import JavaScriptCatalog

from rehab.people.access import for_roles, public, user_of
from rehab.people.models import LANGUAGES
from rehab.people.roles import Role
from rehab.people.web.language import language_of

javascript_catalog = JavaScriptCatalog.as_view(packages=["rehab"])


@public
@require_safe
@cache_control(public=True, max_age=600)
@conditional_page
def show_catalog(request: HttpRequest, language: str) -> HttpResponseBase:
    """Show the translations of the scripts in a language."""
    if language not in dict(LANGUAGES):
        raise Http404
    with translation.override(language):
        return javascript_catalog(request)


@for_roles(*Role)
@require_POST
def choose_language(request: HttpRequest) -> HttpResponse:
    """Set the language of the own account; "" for the clinic's."""
    user = user_of(request)
    chosen = request.POST.get("language", "")
    if chosen not in {"", *dict(LANGUAGES)}:
        messages.error(request, _("There is no such language. Choose one of the list."))
        return redirect("account")
    user.language = chosen
    user.save(update_fields=["language"])
    with translation.override(language_of(user) or None):
        messages.success(request, _("Your pages are in this language now."))
    return redirect("account")
