"""Orders on their way to the server that owns a session, and its refusals on their way back."""

from __future__ import annotations

from typing import Any

import msgspec

from rehab.people.models import User
from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.live.orders import Order
from rehab.sessions.live.servers.intercom import Data
from rehab.training.changes import NotAllowed
from rehab.training.measures import InvalidSetting
from robot.marking import AnyOf, Marked

REFUSALS = {"refused": InvalidSetting, "not_allowed": NotAllowed}


def pack_order(order: Order) -> Data:
    """Return an order as a message; people in it as the keys of their accounts."""
    packed: Data = msgspec.to_builtins(order, enc_hook=_pack_account)
    return packed


def unpack_order(data: Data) -> Order:
    """Return the order of a message. Raises msgspec.ValidationError for anything else."""
    order: Order = msgspec.convert(data, Order, dec_hook=_unpack_account)
    return order


def _pack_account(account: Any) -> int:
    if not isinstance(account, User):
        raise NotImplementedError(f"An order cannot carry {account!r}.")
    return int(account.pk)


def _unpack_account(kind: type, key: Any) -> User:
    """Return an account as a row refers to it: a stop waits for no query."""
    if not isinstance(key, int):
        raise NotImplementedError(f"{key!r} is no account's key.")
    return User(pk=key)


def pack_refusal(problem: InvalidSetting | NotStored) -> Data:
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
