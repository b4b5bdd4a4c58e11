"""Types of fields in clients' frames. One declaration checks a field and words its cure."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import Meta, inspect

from robot.wire.frames import NAME, BadFrame
from robot.wire.limits import MAX_NAME_CHARS

Message = Mapping[str, Any]
Fields = TypeVar("Fields", bound=msgspec.Struct)
_MAX = sys.float_info.max  # beyond are only infinity and what is no number
NAME_WORDS = f"a text of 1 to {MAX_NAME_CHARS} letters, digits or _ . : -"
_AT = re.compile(r"`\$\.(\w+)")
_MISSING = re.compile(r"required field `(\w+)`")

Number = Annotated[float, Meta(ge=-_MAX, le=_MAX, description="a finite number")]
Positive = Annotated[float, Meta(gt=0, le=_MAX, description="a number above 0")]
Whole = Annotated[int, Meta(ge=0, lt=2**31, description="a whole number of 0 or more")]
Count = Annotated[int, Meta(ge=1, lt=2**31, description="a whole number of 1 or more")]
Name = Annotated[str, Meta(pattern=rf"\A(?:{NAME.pattern})\Z", description=NAME_WORDS)]
Code = Annotated[
    str, Meta(pattern=rf"\A(?:{NAME.pattern})?\Z", description=f"{NAME_WORDS}, or empty")
]

Version = Annotated[str, Meta(pattern=r"\A[A-Za-z0-9_.!+-]{0,64}\Z", description="a version")]


class PartOf(msgspec.Struct, frozen=True):
    """Of which package a source or base is, where it is none of GARRY's own."""

    kind: Name
    name: Name
    package: Name
    version: Version


def read_fields(message: Any, kind: type[Fields]) -> Fields:
    """Return the fields of a message. Raises BadFrame, which says what to send instead."""
    try:
        return msgspec.convert(message, kind)
    except (msgspec.ValidationError, OverflowError) as problem:
        raise BadFrame(_cure(str(problem), kind)) from None
    except UnicodeError:  # msgspec reads no half of a surrogate pair
        raise BadFrame("Texts hold no half of a surrogate pair. Leave it out.") from None


def _cure(problem: str, kind: type[msgspec.Struct]) -> str:
    struct, at = inspect.type_info(kind), _AT.search(problem) or _MISSING.search(problem)
    if at is not None and isinstance(struct, inspect.StructType):
        (field,) = (one for one in struct.fields if one.encode_name == at[1])
        return f'"{at[1]}" is {_describe(field.type)}.'
    return f"Send {_describe(struct)}."


def _describe(kind: inspect.Type) -> str:
    """Return what a value of a type is, in words."""
    match kind:
        case inspect.Metadata(extra_json_schema={"description": words}):
            return str(words)
        case inspect.Metadata(type=inner):
            return _describe(inner)
        case inspect.LiteralType(values=values) | inspect.EnumType(cls=values):
            return f"one of: {', '.join(map(str, values))}"
        case inspect.BoolType():
            return "true or false"
        case inspect.NoneType():
            return "null"
        case inspect.UnionType(types=kinds):
            return ", or ".join(map(_describe, kinds))
        case inspect.StructType(fields=fields):
            return f"an object with {', '.join(field.encode_name for field in fields)}"
        case inspect.TupleType(item_types=items):
            return f"a list of {len(items)}: {', '.join(map(_describe, items))}"
    return f"no {type(kind).__name__.removesuffix('Type').lower()} that fits; see /help/protocol/"
