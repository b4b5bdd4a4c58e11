"""The registry of controls: everything that other code knows of a control of the PT's page.

From an entry follow the states that allow the change, what it does to the fold, who may ask for it
(pages and the API), what each audience is sent, its row in the log, its line in a review and its
mark on charts. A control that no other code names needs no member of ``ChangeKind``.
"""

from rehab.training.controls.control import (
    Audience,
    ChartMark,
    Choices,
    Control,
    ControlledSession,
    Payload,
    Requester,
    ValueFormat,
    ValueKind,
)
from rehab.training.controls.registry import (
    CONTROLS,
    TYPE_MARK,
    marked_kinds,
    requestable_kinds,
)

__all__ = [
    "CONTROLS",
    "TYPE_MARK",
    "Audience",
    "ChartMark",
    "Choices",
    "Control",
    "ControlledSession",
    "Payload",
    "Requester",
    "ValueFormat",
    "ValueKind",
    "marked_kinds",
    "requestable_kinds",
]
