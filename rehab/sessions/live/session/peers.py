"""Sources and robots as a session knows them, whatever they are connected by."""

from __future__ import annotations

from typing import Protocol

from rehab.sessions.payloads import Message


class Peer(Protocol):
    """A connected source or robot."""

    @property
    def device_id(self) -> int | None:
        """The device's key."""

    def tell(self, message: Message) -> None:
        """Queue a message."""

    def tell_text(self, text: str) -> None:
        """Queue a message that is a frame's text already."""

    def acknowledge(self, number: int) -> None:
        """Queue the acknowledgment of the steps up to this one."""

    def evict(self, code: int, error: str, message: str) -> None:
        """Close its connection with an error."""
