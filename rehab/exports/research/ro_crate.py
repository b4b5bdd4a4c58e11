"""What describes an export as a whole: an RO-Crate."""

from __future__ import annotations

import json
import mimetypes
from collections.abc import Iterable
from typing import Any

CONTEXT = "https://w3id.org/ro/crate/1.1/context"


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
