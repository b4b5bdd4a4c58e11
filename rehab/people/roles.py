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
    SPONSOR = "sponsor", _("Sponsor of studies")


# The accounts of a demonstration (garry demo).
DEMO_ACCOUNTS = {"lead": Role.LEAD, "pt": Role.PT, "researcher": Role.RESEARCHER}


class Right(Flag):
    """What a role may do with the visible rows of a model."""

    NONE = 0
    VIEW = auto()
    ADD = auto()
    CHANGE = auto()
    DELETE = auto()
    EDIT = VIEW | ADD | CHANGE
    ALL = VIEW | ADD | CHANGE | DELETE


_CARERS = (Role.LEAD, Role.PT)
_VIEWED_BY_CARERS = dict.fromkeys(_CARERS, Right.VIEW)
_VIEWED = _VIEWED_BY_CARERS | {Role.RESEARCHER: Right.VIEW}
_EDITED_BY_CARERS = dict.fromkeys(_CARERS, Right.ALL) | {Role.RESEARCHER: Right.VIEW}
_SHARED = _EDITED_BY_CARERS | {Role.HOST: Right.ALL}
_OF_A_LEAD = {Role.LEAD: Right.ALL, Role.PT: Right.VIEW}

# Model name → role → rights. What is not listed is not allowed. A host runs the server and
# sees accounts and shared settings, never a patient. A researcher sees pseudonyms only, a sponsor
# the figures of studies. Sessions, steps and events are a log: nobody edits them in place.
RIGHTS: dict[str, dict[Role, Right]] = {
    "Clinic": {Role.HOST: Right.EDIT, Role.LEAD: Right.VIEW | Right.CHANGE},
    "User": {Role.HOST: Right.EDIT, Role.LEAD: Right.EDIT},
    "SignOnGroup": {Role.HOST: Right.ALL, Role.LEAD: Right.VIEW},
    "ApiToken": {Role.LEAD: Right.EDIT},
    "Authenticator": {},
    "RecoveryCode": {},
    "ResetRequest": {},
    "SignInAttempts": {},
    "Patient": dict.fromkeys(_CARERS, Right.EDIT),
    "Consent": _VIEWED_BY_CARERS,
    "ConsentText": _VIEWED_BY_CARERS,
    "ImportTombstone": {},
    "AuditEntry": {Role.LEAD: Right.VIEW},
    "LogSeal": {},
    "HistoryEntry": dict.fromkeys(Role, Right.VIEW),
    "Endpoint": {Role.LEAD: Right.ALL},
    "OutboxMessage": {Role.LEAD: Right.VIEW},
    "Station": _OF_A_LEAD,
    "Device": _OF_A_LEAD,
    "Pairing": {},
    "PinAttempts": {},
    "Assessment": _VIEWED | dict.fromkeys(_CARERS, Right.EDIT),
    "Visit": dict.fromkeys(_CARERS, Right.ALL),
    "FamilyLink": _VIEWED_BY_CARERS,
    "MeasureDefinition": _VIEWED | dict.fromkeys((Role.HOST, Role.LEAD), Right.EDIT),
    "Protocol": _SHARED,
    "ProtocolPhase": _SHARED,
    "Preset": _EDITED_BY_CARERS,
    "Questionnaire": _EDITED_BY_CARERS,
    "ClinicTest": _EDITED_BY_CARERS,
    "QuestionnaireResponse": _VIEWED,
    "ComposedGesture": _EDITED_BY_CARERS,
    "GestureStep": _EDITED_BY_CARERS,
    "FeedbackType": _EDITED_BY_CARERS,
    "FeedbackBand": _EDITED_BY_CARERS,
    "TrainingSession": _VIEWED,
    "Step": _VIEWED,
    "SessionEvent": _VIEWED,
    "SessionMetric": _VIEWED,
    "RobotIncident": _VIEWED,
    "ClinicOwner": {},
    "ClinicMove": {},
    "SessionSeal": {},
    "SessionCorrection": _VIEWED | dict.fromkeys(_CARERS, Right.VIEW | Right.ADD),
    # Changed by their pages alone, which know how far a study is.
    "Study": _VIEWED | {Role.SPONSOR: Right.VIEW},
    "StudyVersion": _VIEWED,
    "Arm": _VIEWED,
    "StudyMark": _VIEWED_BY_CARERS,
    "Enrollment": _VIEWED,
    "Allocation": _VIEWED,
    "StudyVisit": _VIEWED,
    "StudyEvent": _VIEWED_BY_CARERS,
    "Screening": _VIEWED_BY_CARERS,
    "AdverseEvent": _VIEWED_BY_CARERS,
    "PowerRun": dict.fromkeys((Role.LEAD, Role.RESEARCHER), Right.VIEW),
    "Leaderboard": _SHARED,
    "BoardChange": {},
    "BoardSnapshot": {},
}


def rights_of(role: str, model_name: str) -> Right:
    """Return what a role may do with a model; nothing for one that the table lacks."""
    if role not in Role.values:
        return Right.NONE
    return RIGHTS.get(model_name, {}).get(Role(role), Right.NONE)


# Who may export: a patient's data by name, and all sessions by pseudonyms (rehab/exports).
PATIENT_EXPORTERS = (Role.LEAD, Role.PT)
SESSION_EXPORTERS = (Role.LEAD, Role.RESEARCHER)

# Models whose rows are persons.
PERSONS = frozenset({"Patient", "User"})


def may_see_names(role: str) -> bool:
    """Return whether a role may learn who patients and staff are."""
    return role not in {Role.RESEARCHER, Role.SPONSOR}


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
