"""The admin pages of all rooms."""

from rehab.boards import admin as boards
from rehab.feedback import admin as feedback
from rehab.gestures import admin as gestures
from rehab.people import admin as people
from rehab.sessions import admin as sessions
from rehab.sessions import setup_admin as session_setup
from rehab.stations import admin as stations

__all__ = [
    "boards",
    "feedback",
    "gestures",
    "people",
    "session_setup",
    "sessions",
    "stations",
]
