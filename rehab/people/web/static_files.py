"""Static files where no proxy and no WhiteNoise serves them: on one machine."""

from __future__ import annotations

from typing import Any

from django.contrib.staticfiles.handlers import ASGIStaticFilesHandler
from django.core.exceptions import SuspiciousOperation
from django.http import Http404, HttpRequest


class StaticFilesHandler(ASGIStaticFilesHandler):
    """Django's handler, which fails on paths that lead out of the static folders."""

    def serve(self, request: HttpRequest) -> Any:
        """Return a file. Raises Http404 for a path that leads elsewhere, or is none."""
        try:
            return super().serve(request)
        except (SuspiciousOperation, ValueError, OSError) as problem:
            raise Http404("There is no such file.") from problem
