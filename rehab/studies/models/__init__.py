"""Studies: what is compared, in which versions, and who must not know or may look early."""

from rehab.studies.models.arm import Arm
from rehab.studies.models.study import (
    METHODS,
    NOT,
    SCHEDULE_FIELDS,
    SPENDINGS,
    Study,
    StudyState,
    StudyVersion,
    outcome_label,
)
from rehab.studies.models.study_mark import StudyMark, has_mark

__all__ = [
    "METHODS",
    "NOT",
    "SCHEDULE_FIELDS",
    "SPENDINGS",
    "Arm",
    "Study",
    "StudyMark",
    "StudyState",
    "StudyVersion",
    "has_mark",
    "outcome_label",
]
