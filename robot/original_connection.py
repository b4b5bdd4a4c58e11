"""The original's topics beside any base, over a connection of their own."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from typing import Any, Self

from robot.behavior.safety import LAPSED_S
from robot.ros.holder import DrivenBase
from robot.ros.original_nodes import TOPICS, OriginalTopicClient
from robot.ros.rosbridge_connection import Bridge


class OriginalTopics:
    """An ``OriginalTopicClient`` with a connection of its own, while open as a context manager."""

    def __init__(
        self,
        url: str,
        names: Collection[str] = tuple(TOPICS),
        base: DrivenBase | None = None,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._url, self._monotonic = url, monotonic
        self._client = OriginalTopicClient(names, base)
        self._bridge = Bridge(self._client, monotonic)

    def __enter__(self) -> Self:
        """Start to connect."""
        self._bridge.open(self._url)
        return self

    def __exit__(self, *_: object) -> None:
        """Close the connection."""
        self._bridge.close()

    @property
    def problem(self) -> str:
        """Why messages do not arrive; empty where they do."""
        with self._bridge.lock:
            return self._bridge.problem or self._client.problem(self._monotonic())

    def handle_message(self, message: Mapping[str, Any]) -> None:
        """Publish the data of a message of the server."""
        with self._bridge.sending():
            self._client.handle_message(message, self._monotonic())

    def publish_decision(self, above: bool, window_s: float) -> None:
        """Publish a decision about a window.

        Parameters
        ----------
        above
            Whether the window's mean reached the threshold.
        window_s
            Length of a window [s].
        """
        with self._bridge.sending():
            self._client.publish_decision(above, window_s, self._monotonic())

    def allow(self, is_allowed: bool) -> None:
        """Allow what moves a robot, or withdraw what was published; to be called at each tick."""
        now_s = self._monotonic()
        self._client.allowed_until_s = now_s + LAPSED_S
        if self._client.is_allowed != is_allowed:
            with self._bridge.sending():
                self._client.allow(is_allowed, now_s)
