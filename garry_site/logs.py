"""Lines of the log, as text or JSON, each with the request that it is of. They name no patient."""

from __future__ import annotations

import json
import logging
import re
import uuid
from collections.abc import Callable
from contextvars import ContextVar
from datetime import UTC, datetime

from django.http import HttpRequest, HttpResponseBase

HEADER = "X-Request-ID"
# What opens a page by itself: a family's link.
SECRET_ADDRESS = re.compile(r"(/family/)[^/\s\"'\\]+")
SAFE_ID = re.compile(r"[A-Za-z0-9-]{8,64}")

request_id: ContextVar[str] = ContextVar("request_id", default="")


class RequestIdMiddleware:
    """Tags each request with an id, the proxy's if it has one, for the answer and the log."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on."""
        given = request.headers.get(HEADER, "")
        token = request_id.set(given if SAFE_ID.fullmatch(given) else uuid.uuid4().hex)
        try:
            response = self.get_response(request)
            response[HEADER] = request_id.get()
            return response
        finally:
            request_id.reset(token)


class LineFormatter(logging.Formatter):
    """Formats a record as text, without secret addresses."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the lines."""
        return SECRET_ADDRESS.sub(r"\1...", super().format(record))


class JsonFormatter(logging.Formatter):
    """Formats a record as one line of JSON: time, level, logger, message, request, traceback."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname,
            "logger": record.name,
            "message": record.getMessage(),
            "request": request_id.get(),
            "traceback": self.formatException(record.exc_info) if record.exc_info else "",
        }
        text = json.dumps({name: value for name, value in line.items() if value})
        return SECRET_ADDRESS.sub(r"\1...", text)
