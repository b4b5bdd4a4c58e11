"""Clinics, the people who work there, and the patients who walk."""

from rehab.people.models.accounts import ScopedUserManager, ServerUserManager, User
from rehab.people.models.choices import (
    SIDES,
    BoardsConsent,
    EndReason,
    ErasureReason,
    ScreenSide,
    ScreenText,
    Severity,
)
from rehab.people.models.clinics import LANGUAGES, Clinic, validate_time_zone
from rehab.people.models.patients import Patient, PatientErased, generate_pseudonym
from rehab.people.models.sign_on import SignOnGroup

__all__ = [
    "LANGUAGES",
    "SIDES",
    "BoardsConsent",
    "Clinic",
    "EndReason",
    "ErasureReason",
    "Patient",
    "PatientErased",
    "ScopedUserManager",
    "ScreenSide",
    "ScreenText",
    "ServerUserManager",
    "Severity",
    "SignOnGroup",
    "User",
    "generate_pseudonym",
    "validate_time_zone",
]
