"""Who may open a page: every view declares it, and a view that does not is closed to all.

`@public` opens a view to strangers, `@for_roles(Role.PT, …)` to signed-in people of these roles.
Which rows they see is decided by `visible_to`. The admin checks access itself (`ScopedAdmin`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from django.contrib.auth.views import redirect_to_login
from django.core.exceptions import PermissionDenied
from django.http import HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import get_object_or_404
from django.utils import timezone
from django.utils.cache import patch_cache_control
from django.utils.translation import gettext

from rehab.people import clinic_limits
from rehab.people.audit import access_log, history
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.people.sign_in import two_stage_sign_in

View = Callable[..., HttpResponseBase]
ViewT = TypeVar("ViewT", bound=Callable[..., Any])  # a page, or a call of the API
PUBLIC: frozenset[Role] = frozenset()


class UndeclaredView(PermissionDenied):
    """A view that does not declare who may open it."""


def public(view: ViewT) -> ViewT:
    """Open a view to everyone, strangers included."""
    view.access = PUBLIC  # type: ignore[attr-defined]
    return view


def for_roles(
    *roles: Role,
    tablets: bool = False,
    enrolling: bool = False,
    patients: bool = True,
    exports: bool = False,
) -> Callable[[ViewT], ViewT]:
    """Open a view to signed-in people of these roles.

    Parameters
    ----------
    tablets
        Paired tablets may open it as well.
    enrolling
        So may people who have to enroll a second factor before they are signed in.
    patients
        It may show data of patients, so opening it is recorded in the audit log.
    exports
        It is a call of the API that takes data out, step by step; a token must allow that.
    """

    def declare(view: ViewT) -> ViewT:
        vars(view).update(
            access=frozenset(roles),
            tablets=tablets,
            enrolling=enrolling,
            patients=patients,
            exports=exports,
        )
        return view

    return declare


def user_of(request: HttpRequest) -> User:
    """Return the signed-in person. Raises PermissionDenied for a stranger."""
    if not isinstance(request.user, User):
        raise PermissionDenied
    return request.user


def tablet_of(request: HttpRequest) -> Any:
    """Return the paired tablet of a request; None for any other browser."""
    return getattr(request, "tablet", None)


def actor_of(request: HttpRequest) -> Any:
    """Return who will see a page: the signed-in person, else the tablet."""
    return request.user if request.user.is_authenticated else tablet_of(request)


def clinic_of(user: User) -> Clinic:
    """Return a person's clinic. Raises PermissionDenied for a host, who has none."""
    if user.clinic is None:
        raise PermissionDenied
    return user.clinic


def get_patient(user: User, patient_id: int) -> Patient:
    """Return a patient that a user may see. Raises Http404 for any other."""
    patients = Patient.objects.visible_to(user).select_related("clinic")
    return get_object_or_404(patients, pk=patient_id)


def _is_guarded(request: HttpRequest) -> bool:
    """Return whether the page or API call of a request is not public."""
    match = request.resolver_match
    view = getattr(request, "call", match and match.func)
    return getattr(view, "access", PUBLIC) != PUBLIC


def _forbid_caching(response: HttpResponseBase) -> None:
    """Forbid browsers to store a response, so that going back after a sign-out shows nothing."""
    if not response.has_header("Cache-Control"):
        patch_cache_control(response, private=True, no_store=True)


class AccessMiddleware:
    """Enforces what views declare, and records who saw what. Sync; it keeps no state."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on; attribute its changes and record what it showed."""
        if wait_s := clinic_limits.take_request(getattr(actor_of(request), "clinic_id", None)):
            headers = {"Retry-After": str(int(wait_s) + 1)}
            return HttpResponse(
                gettext(clinic_limits.CURE), status=429, headers=headers, content_type="text/plain"
            )
        with history.attribute_changes_to(request):
            response = self.get_response(request)
        access_log.record_request(request, response, timezone.now())
        if _is_guarded(request):
            _forbid_caching(response)
        return response

    def process_view(
        self, request: HttpRequest, view: View, args: Any, kwargs: Any
    ) -> HttpResponseBase | None:
        """Let the view run, redirect to the sign-in, or refuse."""
        match = request.resolver_match
        if match is not None and match.app_names == ["admin"]:
            return None
        access: frozenset[Role] | None = getattr(view, "access", None)
        if access is None:
            raise UndeclaredView(
                f"The view {view!r} does not declare who may open it. "
                "Mark it with @public or @for_roles(…) from rehab.people.access."
            )
        if access == PUBLIC:
            return None
        user = request.user
        if user.is_authenticated and user.is_active and user.role in access:
            return None
        if getattr(view, "tablets", False) and tablet_of(request) is not None:
            return None
        if getattr(view, "enrolling", False) and two_stage_sign_in.pending_enrollment(
            request, timezone.now()
        ):
            return None
        if not user.is_authenticated:
            return redirect_to_login(request.get_full_path())
        raise PermissionDenied
