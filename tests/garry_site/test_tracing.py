"""Traces go to a collector where one is named; they hold names and numbers, and no address."""

from __future__ import annotations

import signal
import socket
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any

import pytest
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

from garry_site import tracing
from tests.support.servers import serve

TRACE = "0af7651916cd43dd8448eb211c80319c"
TOKEN = "Q" * 43  # a family's link


@pytest.fixture
def collector() -> Iterator[HTTPServer]:
    """A collector of traces; what it was sent is in ``sent``."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            sent.append(self.rfile.read(int(self.headers["Content-Length"])))
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_: Any) -> None:
            pass

    sent: list[bytes] = []
    server = HTTPServer(("127.0.0.1", 0), Handler)
    server.sent = sent  # type: ignore[attr-defined]
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


def read_spans(sent: list[bytes]) -> dict[str, Any]:
    """Return the spans that were sent, by name."""
    parts = [ExportTraceServiceRequest.FromString(one) for one in list(sent)]
    return {
        span.name: span
        for part in parts
        for resource in part.resource_spans
        for scope in resource.scope_spans
        for span in scope.spans
    }


def test_requests_are_traced_by_their_route(tmp_path, collector):
    settings = {
        "OTEL_EXPORTER_OTLP_ENDPOINT": f"http://127.0.0.1:{collector.server_port}",
        "OTEL_BSP_SCHEDULE_DELAY": "50",  # ms between batches
    }
    with serve(tmp_path, settings=settings) as server:
        for path in ("/sign-in/", f"/family/{TOKEN}/"):
            asked = urllib.request.Request(
                f"http://127.0.0.1:{server.port}{path}",
                headers={"traceparent": f"00-{TRACE}-b7ad6b7169203331-01"},
            )
            try:
                urllib.request.urlopen(asked, timeout=10).close()  # noqa: S310 (our own server)
            except urllib.error.HTTPError as answer:
                assert answer.code == 404
                answer.close()
        until = time.monotonic() + 20
        while len(spans := read_spans(collector.sent)) < 2 and time.monotonic() < until:
            time.sleep(0.05)
    signing_in, family = spans["GET /sign-in/"], spans["GET /family/<str:token>/"]
    assert {signing_in.trace_id.hex(), family.trace_id.hex()} == {TRACE}
    told = {one.key: one.value for one in family.attributes}
    assert told["http.response.status_code"].int_value == 404
    assert len(told["garry.request"].string_value) == 32
    assert not any(TOKEN.encode() in one for one in collector.sent)


@pytest.mark.server
def test_a_stop_waits_for_no_collector(tmp_path):
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        deaf.listen()  # it takes connections, and never answers
        settings = {"OTEL_EXPORTER_OTLP_ENDPOINT": f"http://127.0.0.1:{deaf.getsockname()[1]}"}
        with serve(tmp_path, settings=settings) as server:
            urllib.request.urlopen(f"http://127.0.0.1:{server.port}/healthz", timeout=10).close()
            server.process.send_signal(signal.SIGTERM)
            assert server.process.wait(6) == 0


def test_without_an_endpoint_there_are_none(monkeypatch):
    for name in tracing.ENDPOINTS:
        monkeypatch.delenv(name, raising=False)
    assert not tracing.start_tracing.__wrapped__()


def test_an_endpoint_without_the_package_is_told(monkeypatch, caplog):
    monkeypatch.setenv(tracing.ENDPOINTS[0], "http://127.0.0.1:1")
    monkeypatch.setitem(sys.modules, "opentelemetry", None)
    assert not tracing.start_tracing.__wrapped__()
    assert "'garry[tracing]'" in caplog.text
