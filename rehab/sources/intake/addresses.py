"""Where rows come from: ``tcp://127.0.0.1:9101``."""

from __future__ import annotations

from typing import NamedTuple
from urllib.parse import urlsplit

from rehab.sources.reporting import SourceError

KINDS = ("tcp", "udp", "ws")


class Address(NamedTuple):
    """A transport with a host and a port."""

    kind: str
    host: str
    port: int

    def __str__(self) -> str:
        """Return the address as text."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.kind}://{host}:{self.port}"


def parse_address(text: str, kinds: tuple[str, ...] = KINDS) -> Address:
    """Return the address that a text names. Raises SourceError for anything else."""
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError:
        parts, port = urlsplit(""), None
    if parts.scheme not in kinds or not parts.hostname or port is None:
        examples = ", ".join(f"{kind}://127.0.0.1:9101" for kind in kinds)
        raise SourceError(f"{text!r} is no address. Write one like {examples}.")
    return Address(parts.scheme, parts.hostname, port)
