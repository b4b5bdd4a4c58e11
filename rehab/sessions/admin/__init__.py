"""Admin of sessions, and of what they are set up with."""

from rehab.sessions.admin import sessions, setup

__all__ = ["sessions", "setup"]
