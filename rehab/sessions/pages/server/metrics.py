"""What Prometheus asks for: counts and times of this process, no personal data."""

from __future__ import annotations

import hmac
import shutil
from collections import Counter
from collections.abc import Iterator

from django.conf import settings
from django.db import DatabaseError, connection
from django.http import Http404, HttpRequest, HttpResponse
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.gc_collector import GCCollector
from prometheus_client.process_collector import ProcessCollector
from prometheus_client.registry import Collector

from rehab.people.access import public
from rehab.people.upkeep_runs import Chore
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.database.trouble import Trouble
from rehab.sessions.live.session.prometheus_metrics import REGISTRY
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


class Upkeep(Collector):
    """How the server's chores went, and what it may run out of."""

    def collect(self) -> Iterator[GaugeMetricFamily]:
        """Yield the figures; without the database those of the disk alone."""
        disk = shutil.disk_usage(settings.DATA_DIR)
        yield GaugeMetricFamily(
            "garry_disk_free_ratio", "Free part of the data folder's disk.", disk.free / disk.total
        )
        try:
            chores, (used, limit) = list(Chore.objects.all()), _connections()
        except DatabaseError:  # other figures say so
            return
        well = Counter({one.name: int(one.is_well) for one in chores})
        yield _labeled("garry_chore_well", "1 if a chore's last run succeeded.", "chore", well)
        ages = GaugeMetricFamily(
            "garry_chore_succeeded_timestamp_seconds", "Its last success.", labels=["chore"]
        )
        for one in chores:
            ages.add_metric([one.name], one.succeeded_at.timestamp() if one.succeeded_at else 0.0)
        yield ages
        if limit:
            yield GaugeMetricFamily(
                "garry_database_connections_ratio", "Used part of them.", used / limit
            )


def _connections() -> tuple[int, int]:
    """Return the connections to the database and their limit; 0 where there is none."""
    if connection.vendor != "postgresql":
        return 0, 0
    with connection.cursor() as cursor:
        cursor.execute(
            "SELECT count(*), current_setting('max_connections')::int FROM pg_stat_activity"
        )
        used, limit = cursor.fetchone()
        return used, limit


REGISTRY.register(LiveSessions())
REGISTRY.register(Upkeep())
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
