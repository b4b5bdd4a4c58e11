"""A refusal on its way from the owner of a session to the server that asked."""

from __future__ import annotations

from typing import Any

from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.live.servers.intercom import Data
from rehab.training.changes import NotAllowed
from rehab.training.measures import InvalidSetting
from robot.marking import AnyOf, Marked

REFUSALS = {"refused": InvalidSetting, "not_allowed": NotAllowed}


def pack(problem: InvalidSetting | NotStored) -> Data:
    """Return a refusal as an answer; its words stay translatable."""
    if isinstance(problem, NotStored):
        return {"problem": "not_stored", "message": str(problem)}
    kind = "not_allowed" if isinstance(problem, NotAllowed) else "refused"
    values = {name: _pack_value(value) for name, value in problem.values.items()}
    return {"problem": kind, "message": problem.template, "values": values}


def raise_refusal(answer: Data) -> None:
    """Raise what an owner refused with, if it did."""
    kind = answer.get("problem")
    if kind in REFUSALS:
        values = {name: _unpack_value(value) for name, value in answer["values"].items()}
        raise REFUSALS[kind](answer["message"], **values)
    if kind is not None:
        raise NotStored(answer["message"])


def _pack_value(value: object) -> Any:
    match value:
        case Marked():
            return {"marked": str(value)}
        case AnyOf():
            return {"any_of": list(value)}
        case bool() | int() | float() | str() | None:
            return value
    return str(value)


def _unpack_value(value: Any) -> Any:
    match value:
        case {"marked": word}:
            return Marked(word)
        case {"any_of": words}:
            return AnyOf(words)
    return value
