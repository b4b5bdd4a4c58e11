"""Sends traces where OpenTelemetry is installed and its usual variables say where to.

A trace has names, numbers and times: of a page its route, never its address, which may open a
family's page; of a commit how much it stored (sessions/live/session/prometheus_metrics.py). Nothing
of a patient.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from functools import cache

from django.core.exceptions import MiddlewareNotUsed
from django.http import HttpRequest, HttpResponseBase

from garry_site.logs import request_id

log = logging.getLogger(__name__)

ENDPOINTS = ("OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT")
SERVER_ERROR = 500


class TracingMiddleware:
    """Records each request, as part of the trace that the proxy or a program began."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        if not start_tracing():
            raise MiddlewareNotUsed
        from opentelemetry import propagate, trace

        self.get_response = get_response
        self._tracer = trace.get_tracer("garry")
        self._find_parent = propagate.extract
        self._kind = trace.SpanKind.SERVER
        self._failed = trace.StatusCode.ERROR

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on."""
        method = request.method or ""
        parent = self._find_parent(request.headers)
        with self._tracer.start_as_current_span(
            method, parent, self._kind, record_exception=False, set_status_on_exception=False
        ) as span:
            response = self.get_response(request)
            route = "/" + (request.resolver_match.route if request.resolver_match else "")
            span.update_name(f"{method} {route}")
            span.set_attribute("http.request.method", method)
            span.set_attribute("http.route", route)
            span.set_attribute("http.response.status_code", response.status_code)
            span.set_attribute("garry.request", request_id.get())
            if response.status_code >= SERVER_ERROR:
                span.set_status(self._failed)
            return response


@cache
def start_tracing() -> bool:
    """Begin to send traces from this process. Return whether they are asked for and can be sent."""
    if not any(os.environ.get(name) for name in ENDPOINTS):
        return False
    try:
        from opentelemetry import trace
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
    except ImportError:
        log.warning(
            "No traces are sent: OpenTelemetry is not installed. Run "
            "`pip install 'garry[tracing]'`, or unset %s.",
            " and ".join(ENDPOINTS),
        )
        return False
    name = os.environ.get("OTEL_SERVICE_NAME", "garry")
    # The end does not wait for a collector: what it has not taken by then is lost.
    resource = Resource.create({"service.name": name})
    provider = TracerProvider(resource=resource, shutdown_on_exit=False)
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter()))
    trace.set_tracer_provider(provider)
    return True
