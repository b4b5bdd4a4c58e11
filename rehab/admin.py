"""The admin pages of all rooms."""

from rehab.boards import admin as boards
from rehab.feedback import admin as feedback
from rehab.gestures import admin as gestures
from rehab.outbox import admin as outbox
from rehab.people import admin as people
from rehab.sessions import admin as sessions
from rehab.stations import admin as stations

__all__ = [
    "boards",
    "feedback",
    "gestures",
    "outbox",
    "people",
    "sessions",
    "stations",
]
