"""An admin form that has beside it what a patient would see of it."""

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
    """Rows whose form draws what it would make into a frame, at every key (form_preview.js)."""

    def get_urls(self) -> list[URLPattern]:
        """Give the addresses, the preview's among them."""
        name = f"{self.opts.app_label}_{self.opts.model_name}_preview"
        preview = self.admin_site.admin_view(self.preview)
        return [path("preview/", preview, name=name), *super().get_urls()]

    @method_decorator(require_safe)
    @method_decorator(xframe_options_sameorigin)
    @method_decorator(csp_replace({"frame-ancestors": [SELF]}))
    def preview(self, request: HttpRequest) -> HttpResponse:
        """Show what the form describes. Stores nothing. Refuses whoever could not save it."""
        row = self.get_object(request, request.GET.get("row", "")) or None
        may = self.has_change_permission if row else self.has_add_permission
        if not may(request, *([row] if row else [])):
            raise PermissionDenied
        return self.draw(request, row)

    def draw(self, request: HttpRequest, row: Any) -> HttpResponse:
        """Give the frame's page: what is in ``request.GET`` as the form of this row, or of none."""
        raise NotImplementedError


def find_faults(form: Any) -> Iterator[tuple[str, str]]:
    """Give what is wrong with a form: a field's label, or nothing, and the words."""
    for name, problems in form.errors.items():
        yield (form.fields[name].label if name in form.fields else "", " ".join(problems))
