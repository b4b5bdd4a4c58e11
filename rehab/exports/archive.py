"""A ZIP that is written while it is sent, in constant memory."""

from __future__ import annotations

import io
import json
import os
from collections.abc import AsyncIterator, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED

from asgiref.sync import sync_to_async
from django.core.serializers.json import DjangoJSONEncoder
from django.http import StreamingHttpResponse
from zipstream import ZipStream

from rehab.people.web.csv_tables import CsvWriter

CHUNK_BYTES = 64 * 1024
CSV_LINES = 500  # a chunk

Files = Iterable[tuple[str, Iterable[str] | Iterable[str | bytes]]]


def write_zip(files: Files) -> Iterator[bytes]:
    """Yield a ZIP of texts and bytes in chunks of some 64 KiB."""
    archive = ZipStream(compress_type=ZIP_DEFLATED)
    for name, pieces in files:
        archive.add((each.encode() if isinstance(each, str) else each for each in pieces), name)
        yield from _join(archive.file())
    yield from _join(archive.finalize())


def _join(chunks: Iterable[bytes]) -> Iterator[bytes]:
    """Yield the same bytes in larger chunks, since each costs a thread switch and a frame."""
    parts: list[bytes] = []
    size = 0
    for chunk in chunks:
        parts.append(chunk)
        size += len(chunk)
        if size >= CHUNK_BYTES:
            yield b"".join(parts)
            parts, size = [], 0
    yield b"".join(parts)


def save_zip(files: Files, file: Path) -> None:
    """Write a ZIP into a file that only the owner of this process may read."""
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "wb") as out:
        os.fchmod(descriptor, 0o600)  # also a file that was there with other rights
        for part in write_zip(files):
            out.write(part)


def write_csv(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> Iterator[str]:
    """Yield a table as CSV text, some lines at a time."""
    remaining = iter(rows)
    lines: Iterable[Sequence[Any]] = [header]
    while lines:
        text = io.StringIO()
        CsvWriter(text).write(lines)
        yield text.getvalue()
        lines = list(islice(remaining, CSV_LINES))


def write_json(data: Any) -> Iterator[str]:
    """Yield data as indented JSON."""
    yield json.dumps(data, cls=DjangoJSONEncoder, ensure_ascii=False, indent=2) + "\n"


class StreamedResponse(StreamingHttpResponse):
    """A streamed file. Django's response would collect all of it first when served by ASGI."""

    async def __aiter__(self) -> AsyncIterator[bytes]:
        """Yield each part once the previous one is sent, computed in the request's thread."""
        parts: Any = self.streaming_content
        make_next = sync_to_async(lambda: next(parts, None))
        while (part := await make_next()) is not None:
            yield part


class ZipResponse(StreamedResponse):
    """A streamed ZIP."""

    def __init__(self, files: Files, name: str) -> None:
        super().__init__(
            write_zip(files),
            content_type="application/zip",
            headers={
                "Content-Disposition": f'attachment; filename="{name}"',
                "Cache-Control": "no-store",
            },
        )
