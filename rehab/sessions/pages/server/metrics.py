"""What Prometheus asks for: counts and times of this process, no personal data."""

from __future__ import annotations

import hmac
from collections import Counter
from collections.abc import Iterator

from django.conf import settings
from django.http import Http404, HttpRequest, HttpResponse
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.gc_collector import GCCollector
from prometheus_client.process_collector import ProcessCollector
from prometheus_client.registry import Collector

from rehab.people.access import public
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.database.trouble import Trouble
from rehab.sessions.live.session.instruments import REGISTRY
from rehab.sessions.pages.server.health import find_unready


class LiveSessions(Collector):
    """The sessions in memory and who is connected to them, as they are when it is asked."""

    def collect(self) -> Iterator[GaugeMetricFamily]:
        """Yield the figures; none where no server runs."""
        live = runtimes.peek()
        if live is None:
            return
        sessions = list(live.sessions.copy().values())  # the event loop goes on meanwhile
        states = Counter(one.aggregate.fold.state.value for one in sessions)
        yield _labeled("garry_sessions", "Sessions in memory.", "state", states)
        pages = Counter(
            subscriber.audience.value
            for one in sessions
            for subscriber in one.feed.subscribers.copy()
        )
        yield _labeled("garry_viewers", "Connected pages and robots' screens.", "audience", pages)
        yield GaugeMetricFamily(
            "garry_clinics", "Clinics that live here.", len(live.clinics.epochs)
        )
        yield GaugeMetricFamily(
            "garry_sources", "Connected sources.", sum(one.source is not None for one in sessions)
        )
        yield GaugeMetricFamily(
            "garry_robots", "Connected robots.", sum(one.robot is not None for one in sessions)
        )
        yield GaugeMetricFamily(
            "garry_write_backlog", "Writes that wait for the database.", live.writer.backlog
        )
        now = live.writer.trouble
        troubles = Counter({kind.value: int(kind is now) for kind in Trouble if kind.value})
        yield _labeled("garry_storage_trouble", "1 while steps cannot be stored.", "kind", troubles)
        yield GaugeMetricFamily(
            "garry_ready", "1 while it may get visitors, as /readyz says.", int(not find_unready())
        )


def _labeled(name: str, about: str, label: str, counts: Counter[str]) -> GaugeMetricFamily:
    family = GaugeMetricFamily(name, about, labels=[label])
    for value, count in sorted(counts.items()):
        family.add_metric([value], count)
    return family


REGISTRY.register(LiveSessions())
ProcessCollector(registry=REGISTRY)
GCCollector(registry=REGISTRY)


@public
@never_cache
@require_safe
def metrics(request: HttpRequest) -> HttpResponse:
    """Return all figures to holders of GARRY_METRICS_TOKEN; 404 where no token is set."""
    given = request.headers.get("Authorization", "").removeprefix("Bearer ")
    token = settings.METRICS_TOKEN
    if not token or not hmac.compare_digest(given.encode(), token.encode()):
        raise Http404
    return HttpResponse(generate_latest(REGISTRY), content_type=CONTENT_TYPE_LATEST)
