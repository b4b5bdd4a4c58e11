"""Static files, minified: gathered for a hosted server, or served on one machine.

Without comments the patient's page is a fifth lighter.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from csp.utils import build_policy
from django.conf import settings
from django.contrib.staticfiles.handlers import ASGIStaticFilesHandler
from django.core.exceptions import SuspiciousOperation
from django.http import FileResponse, Http404, HttpRequest
from rjsmin import jsmin
from whitenoise.storage import CompressedManifestStaticFilesStorage

# No minifier: those for Python take the space out of "&:has(a) :is(b)", which is another selector.
CSS_COMMENTS_AND_INDENTS = re.compile(rb"^(?:\s|/\*.*?\*/)+|/\*.*?\*/", re.DOTALL | re.MULTILINE)


def minify(name: str, content: bytes) -> bytes:
    """Return a static file's content: a style sheet or script of GARRY's minified.

    Libraries come minified, and Django's admin stays as it is.
    """
    match name.partition("/")[0]:
        case "css":
            return CSS_COMMENTS_AND_INDENTS.sub(b"", content)
        case "js":
            return str(jsmin(content.decode())).encode()
    return content


class MinifiedStorage(CompressedManifestStaticFilesStorage):  # type: ignore[misc]
    """WhiteNoise's storage, which collectstatic fills for a hosted server."""

    def post_process(self, paths: dict[str, Any], **options: Any) -> Iterator[Any]:
        """Minify what was gathered, then name it by its hash and compress it."""
        if options.get("dry_run"):
            return
        for name in paths:
            path = Path(self.path(name))
            content = path.read_bytes()
            if (minified := minify(name, content)) != content:
                path.write_bytes(minified)
        gathered = {name: (self, name) for name in paths}  # not the files as they are written
        yield from super().post_process(gathered, **options)


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
