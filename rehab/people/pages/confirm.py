"""The page that asks a person to show once more who it is, by the password or a factor."""

from __future__ import annotations

from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.debug import sensitive_post_parameters
from django.views.decorators.http import require_http_methods

from rehab.people.access import for_roles, user_of
from rehab.people.roles import Role
from rehab.people.sign_in import sign_on, step_up
from rehab.people.sign_in.factors import passkeys
from rehab.people.sign_in.forms import ProofForm


def ask_again(request: HttpRequest, title: str, words: str, act: str) -> HttpResponse | None:
    """Return the page that asks for the password or a factor; None once that was shown.

    ``words`` say what is about to be done, ``act`` is the button's text.
    """
    user = user_of(request)
    form = ProofForm(request, user, request.POST if request.method == "POST" else None)
    if form.is_valid():
        step_up.confirm(request, timezone.now())
        return None
    passkey = passkeys.authentication_options(request, user)
    context = {"form": form, "title": title, "words": words, "act": act, "passkey": passkey}
    if user.subject:
        way_back = request.GET.get("next", request.get_full_path())
        context |= {"sign_on": sign_on.button_text(), "next": way_back}
    return render(request, "people/sign_in/confirm.html", context)


@for_roles(*Role, patients=False)
@never_cache
@sensitive_post_parameters()
@require_http_methods(["GET", "HEAD", "POST"])
def confirm(request: HttpRequest) -> HttpResponse:
    """Ask who it is, and lead on to the page that needs it to be shown lately."""
    asked = ask_again(
        request,
        _("Is it you?"),
        _("Show it once more, then go on where you were."),
        _("Continue"),
    )
    return asked or redirect(step_up.way_back(request) or "home")
