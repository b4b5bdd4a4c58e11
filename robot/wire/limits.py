"""Sizes, numbers and times that both ends of a websocket respect (docs/protocol.md)."""

from __future__ import annotations

PROTOCOL_VERSION = 1
# Tells a proxy before several servers which of them to ask: the one that `elsewhere` named.
SERVER_HEADER = "GARRY-Server"
SERVER_COOKIE = "garry_server"  # the same of browsers

MAX_FRAME_BYTES = 64 * 1024
MAX_STEPS = 256  # in one frame, and without an acknowledgment
MAX_REASONS = 8  # of one step
MAX_EXTRA = 40  # named values beside a step's own
MAX_NAME_CHARS = 64
MAX_CUE_GESTURES = 8  # composed ones that come along with a cue

# Times in seconds since 1970 are accepted, times in milliseconds are not.
TIME_MAX_S = 1e10
# With a tiny goal, performance would outgrow charts, database and JSON readers.
PERFORMANCE_MAX = 1000.0

ROBOT_HEARTBEAT_S = 0.25  # the robot stands still after safety.SERVER_SILENT_S
PAGE_HEARTBEAT_S = 1.0  # pages turn gray after 2 s of silence
