"""What the sensors that are paired with a station can measure."""

from __future__ import annotations

from datetime import datetime

from django.db.models import Q

from rehab.stations.models import Device, Station
from rehab.training.measures import WORN_MEASURES

BOTH_LEGS = "step_asymmetry"
ANYWHERE = "cadence"


def measurable(station: Station | None, now: datetime) -> frozenset[str] | None:
    """Return the slugs of the measures that a station's worn sensors have.

    None where anything may be measured: another source is there, or none yet.
    """
    sources = Device.everywhere.filter(
        Q(token_expires_at=None) | Q(token_expires_at__gt=now),
        station=station,
        kind=Device.Kind.SOURCE,
        builtin=False,
        revoked_at=None,
    )
    worn = set(sources.values_list("place", "side"))
    places = {place for place, _side in worn}
    if station is None or not places or "" in places:
        return None
    has_both = any({(place, "left"), (place, "right")} <= worn for place in places)
    return frozenset(
        one.slug
        for one in WORN_MEASURES
        if (one.slug == BOTH_LEGS and has_both)
        or one.slug == ANYWHERE
        or (one.slug != BOTH_LEGS and _place_of(one.slug) in places)
    )


def _place_of(slug: str) -> str:
    """Return where a measure's sensor is worn."""
    return "shank" if slug.startswith("shank") else "foot"
