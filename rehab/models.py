"""The models of all rooms, and the list of those with a change history."""

from rehab.boards import cache_invalidation, snapshots  # noqa: F401  (these register their models)
from rehab.boards.models import Leaderboard
from rehab.feedback.models import FeedbackBand, FeedbackType
from rehab.gestures.models import ComposedGesture, GestureStep
from rehab.outbox.models import Endpoint
from rehab.patients import family, visits  # noqa: F401
from rehab.people import server_keys, upkeep_runs  # noqa: F401
from rehab.people.audit import moves  # noqa: F401
from rehab.people.consent import tombstones  # noqa: F401
from rehab.people.models import Clinic, Patient, User
from rehab.people.sign_in import attempt_counter, resets  # noqa: F401
from rehab.people.sign_in.factors import factors  # noqa: F401
from rehab.people.sign_in.tokens import ApiToken
from rehab.sessions import (  # noqa: F401
    assessment_results,
    corrections,
    log,
    models,
    ownership,
    robot_incidents,
    seals,
)
from rehab.sessions.available_tests import ClinicTest
from rehab.sessions.questionnaires import Questionnaire
from rehab.sessions.setup.presets import Preset
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol, ProtocolPhase
from rehab.stations.models import Device, Station
from rehab.studies import participants, power_runs  # noqa: F401
from rehab.studies.record import adverse_events  # noqa: F401

# People and settings. Sessions, consents and studies are logs themselves.
TRACKED = (
    Clinic,
    User,
    ApiToken,
    Endpoint,
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
    ClinicTest,
    Leaderboard,
)
