"""Gathers the rooms' sockets, nothing else."""

from typing import Any

from django.urls import path, re_path

from rehab.sessions.live.consumers.base import NotFoundConsumer
from rehab.sessions.live.consumers.robot import RobotConsumer
from rehab.sessions.live.consumers.screens import MonitorConsumer, PatientConsumer
from rehab.sessions.live.consumers.source import SourceConsumer

SOCKETS: dict[str, Any] = {
    "ws/source/": SourceConsumer,
    "ws/robot/": RobotConsumer,
    "ws/session/<int:session_id>/patient/": PatientConsumer,
    "ws/session/<int:session_id>/monitor/": MonitorConsumer,
}
not_found: Any = NotFoundConsumer.as_asgi()
websocket_urlpatterns: list[Any] = [
    *(path(route, consumer.as_asgi()) for route, consumer in SOCKETS.items()),
    re_path("", not_found),
]
