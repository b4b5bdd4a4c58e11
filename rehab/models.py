"""The models of all rooms, and the list of those with a change history."""

from rehab.boards.changes import BoardChange
from rehab.boards.models import Leaderboard
from rehab.boards.snapshots import BoardSnapshot
from rehab.feedback.models import FeedbackBand, FeedbackType
from rehab.gestures.models import ComposedGesture, GestureStep
from rehab.patients.family import FamilyLink
from rehab.patients.visits import Visit
from rehab.people.audit.audit_log import AuditEntry
from rehab.people.audit.history import HistoryEntry
from rehab.people.audit.seals import LogSeal
from rehab.people.consent.models import Consent, ConsentText
from rehab.people.consent.tombstones import ImportTombstone
from rehab.people.models import Clinic, Patient, User
from rehab.people.sign_in.attempts import SignInAttempts
from rehab.people.sign_in.factors.factors import Authenticator, RecoveryCode
from rehab.people.sign_in.resets import ResetRequest
from rehab.people.sign_in.tokens import ApiToken
from rehab.sessions.corrections import SessionCorrection
from rehab.sessions.incidents import RobotIncident
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.questionnaires import Questionnaire, QuestionnaireResponse
from rehab.sessions.setup.presets import Preset
from rehab.sessions.setup.protocols import MeasureDefinition, Protocol, ProtocolPhase
from rehab.stations.models import Device, Pairing, PinAttempts, Station
from rehab.studies.models import Arm, Study, StudyMark, StudyVersion
from rehab.studies.participants import Allocation, Enrollment, StudyEvent, StudyVisit
from rehab.studies.power_runs import PowerRun

# People and settings. Sessions, consents and studies are logs themselves.
TRACKED = (
    Clinic,
    User,
    ApiToken,
    Patient,
    Station,
    Device,
    MeasureDefinition,
    Protocol,
    ProtocolPhase,
    ComposedGesture,
    GestureStep,
    FeedbackType,
    FeedbackBand,
    Preset,
    Questionnaire,
    Leaderboard,
)

__all__ = [
    "TRACKED",
    "Allocation",
    "ApiToken",
    "Arm",
    "AuditEntry",
    "Authenticator",
    "BoardChange",
    "BoardSnapshot",
    "Clinic",
    "ComposedGesture",
    "Consent",
    "ConsentText",
    "Device",
    "Enrollment",
    "FamilyLink",
    "FeedbackBand",
    "FeedbackType",
    "GestureStep",
    "HistoryEntry",
    "ImportTombstone",
    "Leaderboard",
    "LogSeal",
    "MeasureDefinition",
    "Pairing",
    "Patient",
    "PinAttempts",
    "PowerRun",
    "Preset",
    "Protocol",
    "ProtocolPhase",
    "Questionnaire",
    "QuestionnaireResponse",
    "RecoveryCode",
    "ResetRequest",
    "RobotIncident",
    "SessionCorrection",
    "SessionEvent",
    "SessionMetric",
    "SignInAttempts",
    "Station",
    "Step",
    "Study",
    "StudyEvent",
    "StudyMark",
    "StudyVersion",
    "StudyVisit",
    "TrainingSession",
    "User",
    "Visit",
]
