"""How a source brings its strides to the server: everything but the strides.

``outbox`` keeps what is not acknowledged, ``player`` walks by a ``clock`` that can stand still,
``live`` is given strides as they are measured; they know no sockets. ``client`` connects them with
the server. docs/protocol.md is the contract.
"""

from rehab.sources.client.client import SourceClient
from rehab.sources.client.clock import SourceClock
from rehab.sources.client.live import LiveFeed
from rehab.sources.client.outbox import (
    Outbox,
    OutOfStep,
    UnsendableStride,
    write_step,
)
from rehab.sources.client.player import Player, Walk

__all__ = [
    "LiveFeed",
    "OutOfStep",
    "Outbox",
    "Player",
    "SourceClient",
    "SourceClock",
    "UnsendableStride",
    "Walk",
    "write_step",
]
