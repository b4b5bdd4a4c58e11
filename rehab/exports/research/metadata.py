"""What describes an export as a whole: an RO-Crate, and how far people stand out in it."""

from __future__ import annotations

import io
import json
import mimetypes
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

from rehab.exports.session_table import PARTICIPANT
from rehab.people.web.csv_tables import CsvWriter

SMALL = 5  # people alike below which a group is named: the usual limit of statistics offices
CONTEXT = "https://w3id.org/ro/crate/1.1/context"
# What somebody who knows a person may know of the columns about participants.
QUASI = tuple(column.name for column in PARTICIPANT)


def write_crate(names: Iterable[str], title: str, published: str, version: str) -> str:
    """Return ro-crate-metadata.json (RO-Crate 1.1) of an archive.

    Parameters
    ----------
    names
        Of the archive's files.
    title, published, version
        Of the export: its name, its day or year (ISO 8601); of GARRY.
    """
    files = sorted(names)
    about = {
        "@id": "ro-crate-metadata.json",
        "@type": "CreativeWork",
        "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
        "about": {"@id": "./"},
    }
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": title,
        "description": "Walking with feedback on each step, by pseudonyms, exported by GARRY.",
        "datePublished": published,
        "license": "To be set by who shares the data",
        "hasPart": [{"@id": name} for name in files],
    }
    made = {"@id": "#garry", "@type": "SoftwareApplication", "name": "GARRY", "version": version}
    parts: list[dict[str, Any]] = [
        {
            "@id": name,
            "@type": "File",
            "encodingFormat": mimetypes.guess_type(name)[0] or "application/octet-stream",
        }
        for name in files
    ]
    graph = {"@context": CONTEXT, "@graph": [about, root, made, *parts]}
    return json.dumps(graph, indent=1) + "\n"


def write_anonymity(people: Sequence[dict[str, Any]]) -> str:
    """Return as CSV how many people are alike in what others may know of them.

    k-anonymity (Sweeney 2002, Int J Uncertainty Fuzziness 10:557-570): the smallest number of
    people with the same values; by all columns together, and by each alone.

    Parameters
    ----------
    people
        One row for each person, with the columns of `PARTICIPANT`.
    """
    rows: list[list[Any]] = [["columns", "people", "k", f"people in groups below {SMALL}"]]
    for columns in (QUASI, *((name,) for name in QUASI)):
        groups = Counter(tuple(str(one.get(name)) for name in columns) for one in people)
        small = sum(count for count in groups.values() if count < SMALL)
        k = min(groups.values(), default=0)
        rows.append([" ".join(columns), len(people), k, small])
    text = io.StringIO()
    CsvWriter(text).write(rows)
    return text.getvalue()
