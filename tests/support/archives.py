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
        names = archive.namelist()  # some are Parquet
        return {name: archive.read(name).decode(errors="backslashreplace") for name in names}


def words_of(response: Any) -> str:
    """Return all text of a response, also the files of an archive and their names."""
    data = body_of(response)
    if data.startswith(b"PK"):
        return "\n".join(f"{name}\n{text}" for name, text in open_archive(data).items())
    return data.decode(errors="backslashreplace")


def rows_of(text: str) -> list[dict[str, str]]:
    """Return the rows of a table by column."""
    return list(csv.DictReader(io.StringIO(text, newline="")))
