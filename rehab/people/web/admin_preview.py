"""An admin form with a preview of what a patient would see."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from csp.constants import SELF
from csp.decorators import csp_replace
from django.core.exceptions import PermissionDenied
from django.http import HttpRequest, HttpResponse
from django.urls import URLPattern, path
from django.utils.decorators import method_decorator
from django.views.decorators.clickjacking import xframe_options_sameorigin
from django.views.decorators.http import require_safe

from rehab.people.web.admin_base import ScopedAdmin


class PreviewAdmin(ScopedAdmin):
    """Rows whose form updates a preview while one types (static/js/admin/form_preview.js)."""

    def get_urls(self) -> list[URLPattern]:
        """Return the URLs, with that of the preview."""
        name = f"{self.opts.app_label}_{self.opts.model_name}_preview"
        preview = self.admin_site.admin_view(self.preview)
        return [path("preview/", preview, name=name), *super().get_urls()]

    @method_decorator(require_safe)
    @method_decorator(xframe_options_sameorigin)
    @method_decorator(csp_replace({"frame-ancestors": [SELF]}))
    def preview(self, request: HttpRequest) -> HttpResponse:
        """Show what the form describes, for people who could save it. Stores nothing."""
        row = self.get_object(request, request.GET.get("row", "")) or None
        may = self.has_change_permission if row else self.has_add_permission
        if not may(request, *([row] if row else [])):
            raise PermissionDenied
        return self.render_preview(request, row)

    def render_preview(self, request: HttpRequest, row: Any) -> HttpResponse:
        """Return the frame's page, for the form of ``row`` (None: a new one) in ``request.GET``."""
        raise NotImplementedError


def iter_form_errors(form: Any) -> Iterator[tuple[str, str]]:
    """Return the errors of a form: the field's label, "" for the whole form, and the text."""
    for name, problems in form.errors.items():
        yield (form.fields[name].label if name in form.fields else "", " ".join(problems))
