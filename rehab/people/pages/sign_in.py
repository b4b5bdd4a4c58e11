"""Pages to sign in and out."""

from __future__ import annotations

from typing import Any

from django.conf import settings
from django.contrib import messages
from django.contrib.auth import logout
from django.contrib.auth.views import LoginView
from django.http import HttpRequest, HttpResponse, HttpResponseRedirect
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.debug import sensitive_post_parameters
from django.views.decorators.http import require_http_methods, require_POST

from rehab.people.access import public
from rehab.people.models import User
from rehab.people.roles import DEMO_ACCOUNTS, Role
from rehab.people.sign_in import sign_on, two_stage_sign_in
from rehab.people.sign_in.factors import factors, passkeys
from rehab.people.sign_in.forms import FactorForm, SignInForm


def landing_page(user: User) -> str:
    """Return the page to show after a sign-in that asked for none."""
    pages: dict[str, str] = {Role.LEAD: "start", Role.PT: "start", Role.SPONSOR: "studies"}
    return reverse(pages.get(user.role, "admin:index"))


def go_on(request: HttpRequest, user: User, next_url: str) -> HttpResponse:
    """Sign in a person whose account is proven, or lead on to the second factor."""
    if two_stage_sign_in.begin(request, user, next_url, timezone.now()):
        return HttpResponseRedirect(next_url)
    has_factor = factors.authenticators_of(user).exists()
    return redirect("second-factor" if has_factor else "set-up-second-factor")


class SignIn(LoginView):
    """Name and password."""

    template_name = "people/sign_in/sign_in.html"
    authentication_form = SignInForm

    def get_context_data(self, **given: Any) -> dict[str, Any]:
        """Return what the page shows: the hospital's sign-on, a demonstration's password."""
        return super().get_context_data(
            sign_on=sign_on.button_text(), demo=settings.DEMO, accounts=DEMO_ACCOUNTS, **given
        )

    def form_valid(self, form: Any) -> HttpResponse:
        """Sign in, or go on to the second factor."""
        user: User = form.get_user()
        return go_on(self.request, user, self.get_redirect_url() or landing_page(user))


sign_in = public(SignIn.as_view())


@public
@never_cache
@sensitive_post_parameters()
@require_http_methods(["GET", "HEAD", "POST"])
def verify_second_factor(request: HttpRequest) -> HttpResponse:
    """Verify the code or passkey of a pending sign-in; without a pending one, start over."""
    now = timezone.now()
    user = two_stage_sign_in.pending_second_factor(request, now)
    if user is None:
        return redirect("sign-in")
    form = FactorForm(request, user, request.POST if request.method == "POST" else None)
    if form.is_valid():
        return HttpResponseRedirect(
            two_stage_sign_in.finish(request, user, now, second_factor_verified=True)
        )
    context = {"form": form, "passkey": passkeys.authentication_options(request, user)}
    return render(request, "people/sign_in/second_factor.html", context)


@public
@require_POST
def sign_out(request: HttpRequest) -> HttpResponse:
    """Sign this browser out, and of the hospital's sign-on where it came from there."""
    page = request.build_absolute_uri(reverse("sign-in"))
    there = sign_on.sign_out_address(request, page)
    logout(request)
    messages.success(request, _("You are signed out."))
    return redirect(there or "sign-in")
