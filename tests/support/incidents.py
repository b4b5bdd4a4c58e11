"""Recordings of a robot around a stop."""

from __future__ import annotations

from typing import Any

# A robot went ahead for a second, bumped, and stood.
BUMPED: list[dict[str, Any]] = [
    *({"at_s": n / 50, "tick": [0.2, 0, n / 250, 0, 0, 0.2, 0]} for n in range(50)),
    {"at_s": 1.0, "tick": [0.2, 0, 0.2, 0, 0, 0.2, 0], "hazards": ["bump"]},
    {"at_s": 1.0, "retained": "bump", "is_first": True},
    *({"at_s": 1 + n / 50, "tick": [0, 0, 0.2, 0, 0, 0, 0]} for n in range(1, 50)),
]
