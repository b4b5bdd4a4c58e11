"""Static files, minified: gathered for a hosted server, or served on one machine.

A minified file has no comments, which are a quarter of what the patient's page loads.
"""

from __future__ import annotations

from typing import Any

from csp.utils import build_policy
from django.conf import settings
from django.contrib.staticfiles.handlers import ASGIStaticFilesHandler
from django.core.exceptions import SuspiciousOperation
from django.core.files.base import ContentFile, File
from django.http import FileResponse, Http404, HttpRequest
from rcssmin import cssmin
from rjsmin import jsmin
from whitenoise.storage import CompressedManifestStaticFilesStorage

# GARRY's own; libraries come minified, and Django's admin stays as it is.
MINIFIERS = {"css": cssmin, "js": jsmin}


def minify(name: str, content: bytes) -> bytes:
    """Return a static file's content: a style sheet or script of GARRY's minified."""
    minifier = MINIFIERS.get(name.partition("/")[0])
    return minifier(content.decode()).encode() if minifier else content


class MinifiedStorage(CompressedManifestStaticFilesStorage):  # type: ignore[misc]
    """WhiteNoise's storage, which collectstatic fills for a hosted server."""

    def save(self, name: str, content: File[bytes], max_length: int | None = None) -> str:
        """Store a file, and return its name."""
        minified = ContentFile(minify(name, content.read()))
        return str(super().save(name, minified, max_length=max_length))


class StaticFilesHandler(ASGIStaticFilesHandler):
    """Django's handler, which fails on paths that lead out of the static folders.

    Its files are served before any middleware, and so get its headers here.
    """

    def get_response(self, request: HttpRequest) -> Any:
        """Return a file, or the page that there is none."""
        return _add_headers(super().get_response(request))

    async def get_response_async(self, request: HttpRequest) -> Any:
        """Return a file, or the page that there is none."""
        return _add_headers(await super().get_response_async(request))

    def serve(self, request: HttpRequest) -> Any:
        """Return a file. Raises Http404 for a path that leads elsewhere, or is none."""
        try:
            response = super().serve(request)
            if settings.DEBUG or not isinstance(response, FileResponse):
                return response
            content = minify(self.file_path(request.path), response.getvalue())
            response.streaming_content = [content]
            response.headers["Content-Length"] = str(len(content))
            return response
        except (SuspiciousOperation, ValueError, OSError) as problem:
            raise Http404("There is no such file.") from problem


def _add_headers(response: Any) -> Any:
    response.headers.setdefault("Content-Security-Policy", build_policy())
    response.headers.setdefault("X-Content-Type-Options", "nosniff")
    return response
