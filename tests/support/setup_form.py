"""A session's set-up form as a browser sends it, for tests."""

from __future__ import annotations

from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.protocol_models import Protocol
from rehab.stations.models import Station


def choices(place: Station, protocol: str = "Training only", **others: object) -> dict[str, object]:
    rule = Protocol.everywhere.get(name=protocol, clinic=None)
    return {
        "valence": "negative",
        "goal_by": "value",
        "goal_value": "4.05",
        "goal_percent": "110",
        "wanted_hits": "65",
        "minutes": "12",
        "protocol": rule.pk,
        "station": place.pk,
        "source": "live",
        "trained_side": "right",
        "robot": "gentle",
        "robot_above": "(usual)",
        "robot_below": "(usual)",
        **others,
    }


def newest() -> TrainingSession:
    return TrainingSession.everywhere.order_by("pk").last()
