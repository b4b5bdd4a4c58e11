"""Reads the archives that pages export."""

from __future__ import annotations

import csv
import io
import zipfile
from typing import Any


def body_of(response: Any) -> bytes:
    """Return the whole body of a response, streamed or not."""
    return b"".join(response.streaming_content) if response.streaming else response.content


def open_archive(data: bytes) -> dict[str, str]:
    """Return the files of an archive by name."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.testzip() is None
        return {name: archive.read(name).decode() for name in archive.namelist()}


def words_of(response: Any) -> str:
    """Return all text of a response, also in the files of an archive."""
    data = body_of(response)
    if data.startswith(b"PK"):
        return "\n".join(open_archive(data).values())
    return data.decode(errors="replace")


def rows_of(text: str) -> list[dict[str, str]]:
    """Return the rows of a table by column."""
    return list(csv.DictReader(io.StringIO(text, newline="")))
