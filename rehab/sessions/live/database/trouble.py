"""Why the log cannot be stored, in words: a full disk, a database that does not answer."""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum

from django.db import InterfaceError, OperationalError, connection

# Of PostgreSQL (appendix A of its manual): one row may be locked, not the whole database.
ONE_SESSIONS_STATES = frozenset({"55P03", "57014", "40P01", "40001"})
DISK_FULL_STATE = "53100"


class Trouble(StrEnum):
    """Why nothing is stored."""

    NONE = ""
    LATE = "late"
    DISK_FULL = "disk_full"


class NotStored(RuntimeError):
    """A change or step could not be committed; the session is rebuilt from its log."""


WORDS = {
    Trouble.LATE: "The database does not answer: steps wait to be stored. Look at the database and "
    "its disk; the log of the server says since when.",
    Trouble.DISK_FULL: "The disk of the database is full: steps cannot be stored. Make room on it.",
}
NOT_STORED = "A step could not be stored. Connect again."


def classify_failure(problem: BaseException) -> Trouble:
    """Return what a failed write means for the database."""
    for one in _causes(problem):
        if getattr(one, "sqlstate", None) == DISK_FULL_STATE or "disk is full" in str(one):
            return Trouble.DISK_FULL
    return Trouble.NONE


def describe_failure(problem: BaseException) -> str:
    """Return why a step was not stored, and what to do."""
    return WORDS.get(classify_failure(problem), NOT_STORED)


def concerns_all(problem: BaseException) -> bool:
    """Return whether no other session could be written either: to try each would take too long."""
    if not isinstance(problem, OperationalError | InterfaceError):
        return False
    if connection.vendor == "sqlite":
        return True  # one writer at a time: locked, full or broken for everyone
    states = {getattr(one, "sqlstate", None) for one in _causes(problem)}
    return not states & ONE_SESSIONS_STATES


def _causes(problem: BaseException | None) -> Iterator[BaseException]:
    while problem is not None:
        yield problem
        problem = problem.__cause__
