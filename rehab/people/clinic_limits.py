"""The share of a clinic: what it may ask of one server, so that others go on beside it.

Devices and people have limits of their own (the proxy's, and `web.api_base`).
"""

from __future__ import annotations

import time

from django.conf import settings
from django.utils.translation import gettext_noop

from rehab.people.token_buckets import TokenBuckets

SOCKETS_A_SESSION = 6  # tablet, source, robot, therapist; two who look on
REQUESTS_A_SESSION = 6  # at once, as when all pages come back; one more each ten seconds
INTERVAL_S = 10.0
CURE = gettext_noop(
    "A program or page of your clinic asks too often: close what is not needed. A clinic with more "
    "sessions at once: the host raises GARRY_CLINIC_SESSIONS."
)

_requests = TokenBuckets(
    settings.CLINIC_SESSIONS * REQUESTS_A_SESSION, INTERVAL_S / settings.CLINIC_SESSIONS
)


def max_sockets() -> int:
    """Return how many sockets a clinic may have in a server."""
    return settings.CLINIC_SESSIONS * SOCKETS_A_SESSION


def take_request(clinic_id: int | None) -> float:
    """Count a request and return 0, or return the seconds to wait; hosts have no limit."""
    return 0.0 if clinic_id is None else _requests.take(clinic_id, time.monotonic())
