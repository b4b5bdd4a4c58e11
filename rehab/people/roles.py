"""Who may do what: one table for admin, pages, API and sockets."""

from __future__ import annotations

from enum import Flag, auto

from django.db.models import TextChoices
from django.utils.translation import gettext_lazy as _


class Role(TextChoices):
    """The role of a person. Devices have none: see `stations.models.Device`."""

    HOST = "host", _("Host")
    LEAD = "lead", _("Clinic lead")
    PT = "pt", _("Physical therapist")
    RESEARCHER = "researcher", _("Researcher")


class Right(Flag):
    """What a role may do with the visible rows of a model."""

    NONE = 0
    VIEW = auto()
    ADD = auto()
    CHANGE = auto()
    DELETE = auto()
    EDIT = VIEW | ADD | CHANGE
    ALL = VIEW | ADD | CHANGE | DELETE


# Model name → role → rights. What is not listed is not allowed. A host runs the server and
# sees accounts and shared settings, never a patient. A researcher sees pseudonyms only. Sessions,
# steps and events are a log: nobody edits them in place.
RIGHTS: dict[str, dict[Role, Right]] = {
    "Clinic": {Role.HOST: Right.EDIT, Role.LEAD: Right.VIEW | Right.CHANGE},
    "User": {Role.HOST: Right.EDIT, Role.LEAD: Right.EDIT},
    "ApiToken": {Role.LEAD: Right.EDIT},
    "Authenticator": {},
    "RecoveryCode": {},
    "ResetRequest": {},
    "SignInAttempts": {},
    "Patient": {Role.LEAD: Right.EDIT, Role.PT: Right.EDIT},
    "Consent": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW},
    "ConsentText": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW},
    "ImportTombstone": {},
    "AuditEntry": {Role.LEAD: Right.VIEW},
    "LogSeal": {},
    "HistoryEntry": dict.fromkeys(Role, Right.VIEW),
    "Station": {Role.LEAD: Right.ALL, Role.PT: Right.VIEW},
    "Device": {Role.LEAD: Right.ALL, Role.PT: Right.VIEW},
    "Pairing": {},
    "PinAttempts": {},
    "Visit": {Role.LEAD: Right.ALL, Role.PT: Right.ALL},
    "FamilyLink": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW},
    "MeasureDefinition": {
        Role.HOST: Right.EDIT,
        Role.LEAD: Right.EDIT,
        Role.PT: Right.VIEW,
        Role.RESEARCHER: Right.VIEW,
    },
    "Protocol": {
        Role.HOST: Right.ALL,
        Role.LEAD: Right.ALL,
        Role.PT: Right.ALL,
        Role.RESEARCHER: Right.VIEW,
    },
    "ProtocolPhase": {
        Role.HOST: Right.ALL,
        Role.LEAD: Right.ALL,
        Role.PT: Right.ALL,
        Role.RESEARCHER: Right.VIEW,
    },
    "Preset": {Role.LEAD: Right.ALL, Role.PT: Right.ALL, Role.RESEARCHER: Right.VIEW},
    "Questionnaire": {Role.LEAD: Right.ALL, Role.PT: Right.ALL, Role.RESEARCHER: Right.VIEW},
    "QuestionnaireResponse": {
        Role.LEAD: Right.VIEW,
        Role.PT: Right.VIEW,
        Role.RESEARCHER: Right.VIEW,
    },
    "ComposedGesture": {Role.LEAD: Right.ALL, Role.PT: Right.ALL, Role.RESEARCHER: Right.VIEW},
    "GestureStep": {Role.LEAD: Right.ALL, Role.PT: Right.ALL, Role.RESEARCHER: Right.VIEW},
    "FeedbackType": {Role.LEAD: Right.ALL, Role.PT: Right.ALL, Role.RESEARCHER: Right.VIEW},
    "FeedbackBand": {Role.LEAD: Right.ALL, Role.PT: Right.ALL, Role.RESEARCHER: Right.VIEW},
    "TrainingSession": {
        Role.LEAD: Right.VIEW,
        Role.PT: Right.VIEW,
        Role.RESEARCHER: Right.VIEW,
    },
    "Step": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW, Role.RESEARCHER: Right.VIEW},
    "SessionEvent": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW, Role.RESEARCHER: Right.VIEW},
    "SessionMetric": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW, Role.RESEARCHER: Right.VIEW},
    "RobotIncident": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW, Role.RESEARCHER: Right.VIEW},
    "SessionCorrection": {
        Role.LEAD: Right.VIEW | Right.ADD,
        Role.PT: Right.VIEW | Right.ADD,
        Role.RESEARCHER: Right.VIEW,
    },
    # Changed by their pages alone, which know how far a study is.
    "Study": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW, Role.RESEARCHER: Right.VIEW},
    "StudyVersion": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW, Role.RESEARCHER: Right.VIEW},
    "Arm": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW, Role.RESEARCHER: Right.VIEW},
    "StudyMark": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW},
    "Enrollment": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW, Role.RESEARCHER: Right.VIEW},
    "Allocation": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW, Role.RESEARCHER: Right.VIEW},
    "StudyVisit": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW, Role.RESEARCHER: Right.VIEW},
    "StudyEvent": {Role.LEAD: Right.VIEW, Role.PT: Right.VIEW},
    "PowerRun": {Role.LEAD: Right.VIEW, Role.RESEARCHER: Right.VIEW},
    "Leaderboard": {
        Role.HOST: Right.ALL,
        Role.LEAD: Right.ALL,
        Role.PT: Right.ALL,
        Role.RESEARCHER: Right.VIEW,
    },
    "BoardChange": {},
    "BoardSnapshot": {},
}


def rights_of(role: str, model_name: str) -> Right:
    """Return what a role may do with a model; nothing for one that the table lacks."""
    if role not in Role.values:
        return Right.NONE
    return RIGHTS.get(model_name, {}).get(Role(role), Right.NONE)


# Models whose rows are persons.
PERSONS = frozenset({"Patient", "User"})


def may_see_names(role: str) -> bool:
    """Return whether a role may learn who patients and staff are: a researcher never does."""
    return role != Role.RESEARCHER


def is_hidden_beside(role: str, model_name: str) -> bool:
    """Return whether a row of this model is hidden where a row that the role reads refers to it."""
    return model_name in PERSONS and not may_see_names(role)


# The roles that a person may delegate to a program: the own one, or one with fewer rights.
DELEGABLE_ROLES: dict[Role, tuple[Role, ...]] = {
    Role.LEAD: (Role.LEAD, Role.PT, Role.RESEARCHER),
    Role.PT: (Role.PT, Role.RESEARCHER),
    Role.RESEARCHER: (Role.RESEARCHER,),
}


def may_delegate(role: str, delegated: str) -> bool:
    """Return whether a person with a role may delegate another one to a program."""
    return role in Role.values and delegated in DELEGABLE_ROLES.get(Role(role), ())
