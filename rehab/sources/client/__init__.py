"""How a source sends its strides to the server: everything but the strides.

``step_queue`` stores what is not acknowledged, ``journal`` over the end of the program,
``playback`` plays strides by a clock that can be paused, ``live`` takes strides as they are
measured, ``follower`` follows the session; they know no sockets. ``client`` connects them with the
server. docs/protocol.md is the contract.
"""

from rehab.sources.client.client import SourceClient
from rehab.sources.client.journal import Journal
from rehab.sources.client.live import LiveFeed
from rehab.sources.client.playback import Display, NextStride, PlaybackClock, StridePlayback
from rehab.sources.client.step_queue import (
    StepQueue,
    StepsLost,
    UnsendableStride,
    write_step,
)

__all__ = [
    "Display",
    "Journal",
    "LiveFeed",
    "NextStride",
    "PlaybackClock",
    "SourceClient",
    "StepQueue",
    "StepsLost",
    "StridePlayback",
    "UnsendableStride",
    "write_step",
]
