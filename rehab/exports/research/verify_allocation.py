"""Allocate a closed study again from its seed, and compare. Needs Python 3.9 alone.

python verify_allocation.py FOLDER, which has protocol.json and participants.csv of one study.
"""

from __future__ import annotations

import csv
import hashlib
import json
import sys
from fractions import Fraction
from itertools import count
from pathlib import Path
from typing import Any


class Draws:
    """A stream of draws by the rule that stands in protocol.json (draw_rule)."""

    def __init__(self, *parts: str) -> None:
        prefix = "|".join(f"{len(part)}:{part}" for part in parts)
        digests = (hashlib.sha256(f"{prefix}|{n}".encode()).digest() for n in count())
        self.words = (int.from_bytes(digest[:8], "big") for digest in digests)

    def below(self, limit: int) -> int:
        """Return a number of 0 to limit - 1."""
        return next(word for word in self.words if word < 2**64 // limit * limit) % limit

    def shuffle(self, items: list[str]) -> list[str]:
        """Return the items in a random order."""
        items = items[:]
        for last in range(len(items) - 1, 0, -1):
            other = self.below(last + 1)
            items[last], items[other] = items[other], items[last]
        return items


def allocate(
    rule: dict[str, Any],
    secret: dict[str, Any],
    earlier: list[tuple[list[str], str]],
    levels: list[str],
) -> str:
    """Return the group after the allocations (levels, group) made earlier."""
    weights = {"-".join(group["arms"]): group["weight"] for group in rule["groups"]}
    before = sum(past == levels for past, _group in earlier)
    if rule["method"] == "list":
        return str([r["group"] for r in secret["listed"] if r["levels"] == levels][before])
    if rule["method"] == "blocks":
        draws = Draws(secret["seed"], "blocks", *levels)
        sequence: list[str] = []
        while len(sequence) <= before:
            size = secret["block_sizes"][draws.below(len(secret["block_sizes"]))]
            times = size // sum(weights.values())
            sequence += draws.shuffle([g for g in weights for _ in range(weights[g] * times)])
        return sequence[before]
    draws = Draws(secret["seed"], "minimization", str(len(earlier)))

    def imbalance(joined: str) -> Fraction:
        total = Fraction(0)
        for place, level in enumerate(levels):
            alike = [group for past, group in earlier if past[place] == level]
            shares = [Fraction(alike.count(g) + (g == joined), weights[g]) for g in weights]
            total += max(shares) - min(shares)
        return total

    order = draws.shuffle(list(weights))
    best = min(order, key=imbalance)
    others = [group for group in order if group != best]
    if next(draws.words) // 2**11 / 2**53 < rule["probability"]:
        return best
    return others[draws.below(len(others))]


def verify(folder: Path) -> list[str]:
    """Return what does not fit: no lines where all does."""
    protocol = json.loads((folder / "protocol.json").read_text("utf-8"))
    if "allocation_secret" not in protocol:
        return ["The study is not closed: its seed is still sealed."]
    secret, rule = protocol["allocation_secret"], protocol["versions"][0]["study"]["allocation"]
    text = json.dumps(secret, sort_keys=True, separators=(",", ":"))
    wrong: list[str] = []
    earlier: list[tuple[list[str], str]] = []
    if hashlib.sha256(text.encode()).hexdigest() != rule["commitment_sha256"]:
        wrong.append("The seed is not the one whose SHA-256 was registered.")
    with (folder / "participants.csv").open(encoding="utf-8", newline="") as file:
        for row in sorted(csv.DictReader(file), key=lambda row: int(row["number"])):
            levels = json.loads(row["levels"])
            expected = allocate(rule, secret, earlier, levels)
            if row["group"] != expected:
                wrong.append(f"{row['participant']} is in {row['group']}, drawn was {expected}.")
            earlier.append((levels, row["group"]))
    return wrong


if __name__ == "__main__":
    found = verify(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
    sys.stdout.write(
        "\n".join(found or ["Every participant is in the group that was drawn."]) + "\n"
    )
    sys.exit(bool(found))
