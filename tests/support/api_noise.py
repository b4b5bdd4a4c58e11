"""Calls of the API with nonsense in them, made from the API's own description."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from hypothesis import strategies as st

JUNK_TEXTS = [
    "",
    " ",
    "\x00",
    "a\x00b",
    "\ud800",
    "\u202e",
    "é" * 40,
    "x" * 5000,
    "%00",
    "..",
    "../..",
    "';--",
    "0",
    "-1",
    "1e400",
    "NaN",
    "9" * 400,
    "null",
    "true",
    "2026-13-01T00:00:00Z",
    "0001-01-01T00:00:00+23:59",
    "9999-12-31T23:59:59-23:59",
]
JUNK = [None, True, 0, -1, 2**31, 2**63, 2**64, 10**400, 1e308, -0.0, [], [[]], {}, {"a": {}}]


@dataclass(frozen=True)
class Noise:
    """A call: which one, where to, with which query and body."""

    call: str
    address: str
    body: str


def make_noise(paths: dict[str, Any], schemas: dict[str, Any], known: list[str]) -> Any:
    """Return a strategy of calls. ``known`` are keys and codes of rows, one's own and others'."""
    texts = st.sampled_from(JUNK_TEXTS) | st.text(max_size=20)
    plain = st.sampled_from(JUNK) | texts | st.integers() | st.floats()
    junk = st.recursive(plain, lambda inner: st.lists(inner, max_size=2), max_leaves=4)
    keys = st.sampled_from([int(text) for text in known if text.isdigit()])

    def fitting(schema: dict[str, Any]) -> Any:
        """Return values that are described, those on the border among them."""
        offered: list[Any] = []
        for described in schema.get("anyOf", [schema]):
            reference = described.get("$ref", "").rsplit("/", 1)[-1]
            option = schemas.get(reference, described)
            edges = [option[edge] for edge in EDGES if edge in option]
            match option:
                case {"enum": choices}:
                    offered.append(st.sampled_from(choices))
                case {"type": "integer"}:
                    offered += [keys, st.sampled_from([*edges, 1, 50])]
                case {"type": "number"}:
                    offered += [st.floats(0.1, 15), st.sampled_from([*edges, 100.0])]
                case {"format": "date-time"}:
                    offered.append(st.datetimes().map(lambda at: at.isoformat() + "Z"))
                case {"type": "string"}:
                    offered.append(st.sampled_from(known))
                case {"type": "null"}:
                    offered.append(st.none())
        return st.one_of(*offered)

    @st.composite
    def noise(draw: Any) -> Noise:
        def some(schema: dict[str, Any], otherwise: Any) -> Any:
            return draw(otherwise if draw(st.integers(0, NOISE)) == 0 else fitting(schema))

        path = draw(st.sampled_from(sorted(paths)))
        method = draw(st.sampled_from(sorted(paths[path])))
        described = paths[path][method]
        address, query = path, {}
        for parameter in described["parameters"]:
            if parameter["in"] == "path":
                value = f"{some(parameter['schema'], texts)}"
                address = address.replace(f"{{{parameter['name']}}}", quoted(value) or "x")
            elif draw(st.booleans()):
                query[parameter["name"]] = f"{some(parameter['schema'], texts)}"
        pairs = "&".join(f"{quoted(name)}={quoted(value)}" for name, value in query.items())
        body = ""
        if "requestBody" in described:
            reference = described["requestBody"]["content"]["application/json"]["schema"]["$ref"]
            schema = schemas[reference.rsplit("/", 1)[-1]]
            sent = {
                name: some(one, junk)
                for name, one in schema["properties"].items()
                if name in schema.get("required", ()) or draw(st.integers(0, 3)) == 0
            }
            fate = draw(st.integers(0, 3 * NOISE))
            body = json.dumps(draw(junk) if fate == 0 else sent)
            if fate == 1:
                body = body[: draw(st.integers(0, len(body)))]
        return Noise(f"{method.upper()} {path}", f"{address}?{pairs}", body)

    return noise()


NOISE = 7  # one value in so many, and one more, is nonsense
EDGES = ("minimum", "maximum", "exclusiveMaximum", "minLength", "maxLength")


def quoted(text: str) -> str:
    """Write text so that it stays one part of an address."""
    from urllib.parse import quote

    return quote(text.encode("utf-8", "surrogatepass"), safe="")
