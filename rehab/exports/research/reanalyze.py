"""Redo the results of a closed study from its folder of an export, and compare with its tables.

python reanalyze.py FOLDER [FOLDER …]. Needs Python 3.11, NumPy and SciPy. Several folders are the
same study at several clinics: their participants are analyzed together, the clinic as a stratum.
Whose looks came first at several clinics no folder tells: where looks spend alpha, such a study has
no level, and is not found to be not inferior.
"""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from rehab.studies.analysis.comparison import Difference, carry_over, compare, holm
from rehab.studies.analysis.design_matrix import Observation
from rehab.studies.analysis.sequential import ALPHA, levels

CLOSE = 1e-9  # relative difference to the tables that rounding explains


class Trial:
    """A study as its folders have it.

    Parameters
    ----------
    folders
        Of one clinic each.
    """

    def __init__(self, folders: Sequence[Path]) -> None:
        protocol = json.loads((folders[0] / "protocol.json").read_text("utf-8"))
        first, last = (protocol["versions"][n]["study"] for n in (0, -1))
        self.crossover = last["design"] == "crossover"
        self.primary = first["primary_outcome"]
        self.plan = last.get("analysis", {})
        self.planned = last["participants"] * len(folders)
        better = {row["outcome"]: row["better"] for row in read(folders[0] / "definitions.csv")}
        self.higher_is_better = better[self.primary] == "higher"
        self.rows: list[dict[str, str]] = []
        for number, folder in enumerate(folders):
            for row in read(folder / "outcomes.csv"):
                code = row["participant"] if len(folders) == 1 else f"{number}/{row['participant']}"
                clinic = {"stratum_clinic": str(number)} if len(folders) > 1 else {}
                self.rows.append(row | {"participant": code} | clinic)
        self.labels = {row["arm"]: row["group"] for row in self.rows}
        self.arms = [arm["code"] for arm in last["arms"] if arm["code"] in self.labels]
        self.status = {row["outcome"]: row["status"] for row in self.rows}
        looks = [len(read(folder / "looks.csv")) for folder in folders]
        spending = self.plan.get("spending")
        self.level: float | None = ALPHA
        if spending and len(folders) > 1 and max(looks) > 1:  # each folder's last one is the end
            self.level = None
        elif spending and len(folders) == 1:
            counts = [int(row["participants"]) for row in read(folders[0] / "looks.csv")]
            at_looks = levels(spending, counts, self.planned, is_last=True) if counts else [ALPHA]
            self.level = at_looks[-1]

    def observations(self, outcome: str, *, per_protocol: bool = False) -> list[Observation]:
        """Return an outcome of all visits, or of those without a deviation."""
        return [
            Observation(
                row["participant"],
                row["arm"],
                int(row["visit"]),
                to_number(row["value"]),
                to_number(row["baseline"]),
                int(row["period"]),
                tuple(row[name] for name in row if name.startswith("stratum_")),
            )
            for row in self.rows
            if row["outcome"] == outcome and (not per_protocol or row["per_protocol"] == "true")
        ]

    def differences(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of differences.csv, as far as they are computed."""
        pairs = {
            slug: compare(self.observations(slug), self.arms, crossover=self.crossover).differences
            for slug in self.status
        }
        adjusted: dict[tuple[str, Difference], float] = {}
        secondary = [s for s in pairs if self.status[s] != "exploratory" and s != self.primary]
        for family in ([self.primary], secondary):
            of_family = [(slug, one) for slug in family for one in pairs.get(slug, ())]
            known = [(slug, one) for slug, one in of_family if one.p is not None]
            p = [one.p or 0.0 for _slug, one in known]
            adjusted |= dict(zip(known, holm(p), strict=True))
        for slug, differences in pairs.items():
            followed = self.observations(slug, per_protocol=True)
            kept = compare(followed, self.arms, crossover=self.crossover).differences
            of_protocol = {(one.group, one.reference): one for one in kept}
            for one in differences:
                yield self._row(slug, one) | {
                    "p_holm": adjusted.get((slug, one)),
                    "tipping_point": one.tipping_point(
                        adjusted.get((slug, one)), self.level if slug == self.primary else None
                    ),
                    **_per_protocol(of_protocol.get((one.group, one.reference))),
                }

    def _row(self, slug: str, one: Difference) -> dict[str, Any]:
        is_primary, margin = slug == self.primary, self.plan.get("margin")
        answer = None
        if is_primary and margin and self.level is not None:
            better, confidence = self.higher_is_better, 1 - self.level
            answer = one.is_not_inferior(margin, higher_is_better=better, confidence=confidence)
        missing = one.missing
        return {
            "outcome": slug,
            "group": self.labels[one.group],
            "reference": self.labels[one.reference],
            "participants": one.participants[0],
            "participants_reference": one.participants[1],
            "difference": one.difference.estimate,
            "low_95": one.difference.low,
            "high_95": one.difference.high,
            "hedges_g": one.effect and one.effect.estimate,
            "g_low_95": one.effect and one.effect.low,
            "g_high_95": one.effect and one.effect.high,
            "p": one.p,
            "level": self.level if is_primary else None,
            "not_inferior": answer,
            "missing_visits": missing and missing.visits[0],
            "missing_visits_reference": missing and missing.visits[1],
        }

    def carry_over(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of carry_over.csv."""
        registered = [slug for slug in self.status if self.status[slug] != "exploratory"]
        for slug in registered if self.crossover else ():
            for one in carry_over(self.observations(slug), self.arms):
                yield {
                    "outcome": slug,
                    "group": self.labels[one.group],
                    "reference": self.labels[one.reference],
                    "carry_over": one.difference.estimate,
                    "low_95": one.difference.low,
                    "high_95": one.difference.high,
                    "p": one.p,
                }


def _per_protocol(one: Difference | None) -> dict[str, Any]:
    return {
        "per_protocol_difference": one and one.difference.estimate,
        "per_protocol_low_95": one and one.difference.low,
        "per_protocol_high_95": one and one.difference.high,
    }


def read(file: Path) -> list[dict[str, str]]:
    """Return the rows of a table; none where it is empty or missing."""
    if not file.exists():
        return []
    with file.open(encoding="utf-8", newline="") as text:
        return list(csv.DictReader(text))


def to_number(cell: str) -> float | None:
    """Return a cell as a number; None of an empty one."""
    return float(cell) if cell else None


def to_cell(value: Any) -> str:
    """Return a value that is no fraction as tables have it."""
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def disagreements(name: str, rows: Sequence[dict[str, Any]], table: Path) -> Iterator[str]:
    """Yield each cell of a table that is not what was computed.

    Parameters
    ----------
    name, rows
        Of the table; what was computed.
    table
        The file that an export has.
    """
    for number, (row, stored) in enumerate(zip_longest(rows, read(table)), 1):
        if row is None or stored is None:
            yield f"{name}: {len(rows)} rows were computed, the table has another number."
            return
        for column, value in row.items():
            cell = stored[column]
            if isinstance(value, float):
                known = to_number(cell)
                same = known is not None and abs(known - value) <= CLOSE * max(1.0, abs(value))
            else:
                same = cell == to_cell(value)
            if not same:
                yield f"{name}, row {number}, {column}: {value} was computed, {cell} is stored."


def main(folders: Sequence[Path]) -> int:
    """Print what was computed; of one folder, also where its tables differ. Return how many do."""
    trial = Trial(folders)
    tables = {"differences": list(trial.differences()), "carry_over": list(trial.carry_over())}
    sys.stdout.write(json.dumps(tables, indent=1) + "\n")
    if len(folders) > 1:
        return 0
    wrong = [
        line
        for name, rows in tables.items()
        for line in disagreements(name, rows, folders[0] / f"{name}.csv")
    ]
    sys.stderr.write("\n".join(wrong or ["All tables are as they were computed again."]) + "\n")
    return len(wrong)


if __name__ == "__main__":
    sys.exit(min(main([Path(name) for name in sys.argv[1:]] or [Path()]), 1))
