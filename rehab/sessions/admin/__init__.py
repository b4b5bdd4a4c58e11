"""Admin of sessions, and of what they are set up with."""

from rehab.sessions.admin import presets, sessions, setup

__all__ = ["presets", "sessions", "setup"]
