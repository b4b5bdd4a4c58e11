"""Static files where no proxy and no WhiteNoise serves them: on one machine.

They are served before any middleware, and so get its headers here.
"""

from __future__ import annotations

from typing import Any

from csp.utils import build_policy
from django.contrib.staticfiles.handlers import ASGIStaticFilesHandler
from django.core.exceptions import SuspiciousOperation
from django.http import Http404, HttpRequest


class StaticFilesHandler(ASGIStaticFilesHandler):
    """Django's handler, which fails on paths that lead out of the static folders."""

    def get_response(self, request: HttpRequest) -> Any:
        """Return a file, or the page that there is none."""
        return _add_headers(super().get_response(request))

    async def get_response_async(self, request: HttpRequest) -> Any:
        """Return a file, or the page that there is none."""
        return _add_headers(await super().get_response_async(request))

    def serve(self, request: HttpRequest) -> Any:
        """Return a file. Raises Http404 for a path that leads elsewhere, or is none."""
        try:
            return super().serve(request)
        except (SuspiciousOperation, ValueError, OSError) as problem:
            raise Http404("There is no such file.") from problem


def _add_headers(response: Any) -> Any:
    response.headers.setdefault("Content-Security-Policy", build_policy())
    response.headers.setdefault("X-Content-Type-Options", "nosniff")
    return response
