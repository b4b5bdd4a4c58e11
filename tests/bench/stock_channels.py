"""The relay as Channels' own tutorial has it: consumers, and a group of the Redis layer a session.

`python stock_channels.py PORT REDIS_URL`: one process, by daphne; nothing is checked or stored.
"""

from __future__ import annotations

import sys
from functools import partial
from typing import Any

from channels.generic.websocket import AsyncWebsocketConsumer
from channels.routing import URLRouter
from daphne.server import Server
from django.conf import settings
from django.urls import path


class Source(AsyncWebsocketConsumer):
    """Sends what it is told to its session's group."""

    async def receive(self, text_data: str | None = None, bytes_data: bytes | None = None) -> None:
        key = self.scope["url_route"]["kwargs"]["key"]
        await self.channel_layer.group_send(key, {"type": "tell", "text": text_data})


class Viewer(AsyncWebsocketConsumer):
    """Tells what its session's group is sent."""

    async def connect(self) -> None:
        key = self.scope["url_route"]["kwargs"]["key"]
        await self.channel_layer.group_add(key, self.channel_name)
        await self.accept()

    async def tell(self, event: dict[str, Any]) -> None:
        """Send one step to the page."""
        await self.send(text_data=event["text"])


def main(port: int, redis: str) -> None:
    """Serve until killed."""
    layer = {"BACKEND": "channels_redis.pubsub.RedisPubSubChannelLayer"}
    settings.configure(CHANNEL_LAYERS={"default": layer | {"CONFIG": {"hosts": [redis]}}})
    consumers: dict[str, Any] = {"source/<str:key>": Source, "viewer/<str:key>": Viewer}
    router = URLRouter([*(path(route, one.as_asgi()) for route, one in consumers.items())])
    endpoint = f"tcp:port={port}:interface=127.0.0.1"
    ready = partial(print, "Ready", flush=True)
    Server(router, endpoints=[endpoint], ready_callable=ready, verbosity=0).run()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
