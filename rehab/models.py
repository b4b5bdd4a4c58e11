"""Gathers the rooms' models, nothing else."""

from rehab.boards.models import Leaderboard
from rehab.people.models import Clinic, Patient, User
from rehab.sessions.models import (
    Measure,
    Protocol,
    ProtocolPhase,
    SessionEvent,
    SessionMetric,
    Step,
    TrainingSession,
)
from rehab.stations.models import Device, Station

__all__ = [
    "Clinic",
    "Device",
    "Leaderboard",
    "Measure",
    "Patient",
    "Protocol",
    "ProtocolPhase",
    "SessionEvent",
    "SessionMetric",
    "Station",
    "Step",
    "TrainingSession",
    "User",
]
