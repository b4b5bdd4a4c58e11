"""Reads the archives that pages give out."""

from __future__ import annotations

import csv
import io
import zipfile
from typing import Any


def body_of(response: Any) -> bytes:
    """Give an answer's whole body, also of one that comes bit by bit."""
    return b"".join(response.streaming_content) if response.streaming else response.content


def open_archive(data: bytes) -> dict[str, str]:
    """Give the files of an archive by their names."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.testzip() is None
        return {name: archive.read(name).decode() for name in archive.namelist()}


def words_of(response: Any) -> str:
    """Give all that an answer says, also in the files of an archive."""
    data = body_of(response)
    if data.startswith(b"PK"):
        return "\n".join(open_archive(data).values())
    return data.decode(errors="replace")


def rows_of(text: str) -> list[dict[str, str]]:
    """Give a table's rows by column."""
    return list(csv.DictReader(io.StringIO(text, newline="")))
