"""Lines of the log, as text or JSON, each with the request that it is of. They name no patient."""

from __future__ import annotations

import json
import logging
import re
import time
import uuid
from collections import Counter
from collections.abc import Callable
from contextvars import ContextVar
from datetime import UTC, datetime

from django.http import HttpRequest, HttpResponseBase

from rehab.people.token_buckets import TokenBuckets

HEADER = "X-Request-ID"
# What opens a page by itself: a family's link.
SECRET_ADDRESS = re.compile(r"(/family/)[^/\s\"'\\]+")
SAFE_ID = re.compile(r"[A-Za-z0-9-]{8,64}")

# Lines about refusals of a kind: so many at once, then one in so many seconds.
REFUSALS_AT_ONCE, REFUSAL_EVERY_S = 3, 60.0
REFUSAL_LETTERS = 200

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


class RefusalFilter(logging.Filter):
    """Makes what Django refuses as suspicious one line of warning, and few of each kind.

    A stranger can send a forged Host or filter as often as he likes; errors of ours must be seen
    among the lines.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock = clock
        self._lines = TokenBuckets(REFUSALS_AT_ONCE, REFUSAL_EVERY_S)
        self._left_out: Counter[str] = Counter()

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether to write a record; shorten one of a refusal."""
        if not record.name.startswith("django.security"):
            return True
        if self._lines.take(record.name, self._clock()):
            self._left_out[record.name] += 1
            return False
        words = " ".join(record.getMessage().split())[:REFUSAL_LETTERS]
        left_out = self._left_out.pop(record.name, 0)
        record.msg = "Refused: %s" + (" (and %d more before)" if left_out else "")
        record.args = (words, left_out) if left_out else (words,)
        record.levelno, record.levelname = logging.WARNING, "WARNING"
        record.exc_info = record.exc_text = record.stack_info = None
        return True


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
