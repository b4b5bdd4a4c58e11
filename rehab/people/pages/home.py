"""The front page, the guide for therapists, and the catalog of the scripts' translations."""

from django.http import Http404, HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import render
from django.utils import translation
from django.views.decorators.cache import cache_control
from django.views.decorators.http import conditional_page, require_safe
from django.views.i18n import JavaScriptCatalog

from rehab.people.access import for_roles, public, user_of
from rehab.people.models import LANGUAGES
from rehab.people.roles import Role
from rehab.people.web.help_pages import may_report, read_page
from rehab.training.valences import VALENCES

javascript_catalog = JavaScriptCatalog.as_view(packages=["rehab"])


@public
@require_safe
def home(request: HttpRequest) -> HttpResponse:
    """Show the front page."""
    return render(request, "people/home.html", {"valences": VALENCES.values()})


@for_roles(*Role, patients=False)
@require_safe
def show_help(request: HttpRequest, page: str = "using") -> HttpResponse:
    """Show a page of the documentation, the guide for therapists unless another one is named."""
    guide = read_page(page, request.build_absolute_uri("/").rstrip("/"))
    if not guide:
        raise Http404
    return render(
        request,
        "people/help.html",
        {"guide": guide, "is_using": page == "using", "may_report": may_report(user_of(request))},
    )


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
