"""Gathers the rooms' models, nothing else."""

from rehab.boards.models import BoardCount, BoardEntry, Leaderboard
from rehab.gestures.models import Gesture, GestureStep
from rehab.people.factors import Authenticator, RecoveryCode
from rehab.people.models import Clinic, Patient, User
from rehab.people.tokens import ApiToken
from rehab.sessions.corrections import SessionCorrection
from rehab.sessions.models import (
    Measure,
    Protocol,
    ProtocolPhase,
    SessionEvent,
    SessionMetric,
    Step,
    TrainingSession,
)
from rehab.sessions.presets import Preset
from rehab.sessions.visits import Visit
from rehab.stations.models import Device, LeaveTries, Station

__all__ = [
    "ApiToken",
    "Authenticator",
    "BoardCount",
    "BoardEntry",
    "Clinic",
    "Device",
    "Gesture",
    "GestureStep",
    "Leaderboard",
    "LeaveTries",
    "Measure",
    "Patient",
    "Preset",
    "Protocol",
    "ProtocolPhase",
    "RecoveryCode",
    "SessionCorrection",
    "SessionEvent",
    "SessionMetric",
    "Station",
    "Step",
    "TrainingSession",
    "User",
    "Visit",
]
