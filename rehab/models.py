"""Gathers the rooms' models, nothing else."""

from rehab.boards.models import BoardCount, BoardEntry, Leaderboard
from rehab.feedback.models import FeedbackBand, FeedbackType
from rehab.gestures.models import Gesture, GestureStep
from rehab.people.factors import Authenticator, RecoveryCode
from rehab.people.models import Clinic, Patient, User
from rehab.people.tokens import ApiToken
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
    "ApiToken",
    "Authenticator",
    "BoardCount",
    "BoardEntry",
    "Clinic",
    "Device",
    "FeedbackBand",
    "FeedbackType",
    "Gesture",
    "GestureStep",
    "Leaderboard",
    "Measure",
    "Patient",
    "Protocol",
    "ProtocolPhase",
    "RecoveryCode",
    "SessionEvent",
    "SessionMetric",
    "Station",
    "Step",
    "TrainingSession",
    "User",
]
