"""A ZIP that is made while it is sent: no part waits for the rest, and memory stays constant."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import AsyncIterator, Iterable, Iterator, Sequence
from itertools import islice
from typing import Any
from zipfile import ZIP_DEFLATED

from asgiref.sync import sync_to_async
from django.core.serializers.json import DjangoJSONEncoder
from django.http import StreamingHttpResponse
from zipstream import ZipStream

from rehab.exports.tables import to_cells

PART = 64 * 1024
LINES = 500

Files = Iterable[tuple[str, Iterable[str]]]


def write_zip(files: Files) -> Iterator[bytes]:
    """Yield a ZIP of texts in parts of some 64 KiB."""
    archive = ZipStream(compress_type=ZIP_DEFLATED)
    for name, texts in files:
        archive.add((text.encode() for text in texts), name)
        yield from _join(archive.file())
    yield from _join(archive.finalize())


def _join(chunks: Iterable[bytes]) -> Iterator[bytes]:
    """Yield the same bytes in larger parts: each one costs a hop between threads and a frame."""
    parts: list[bytes] = []
    size = 0
    for chunk in chunks:
        parts.append(chunk)
        size += len(chunk)
        if size >= PART:
            yield b"".join(parts)
            parts, size = [], 0
    yield b"".join(parts)


def write_csv(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> Iterator[str]:
    """Give a table as text, some lines at a time."""
    cells = to_cells(rows)
    lines: Iterable[Sequence[Any]] = [header]
    while lines:
        text = io.StringIO()
        csv.writer(text, lineterminator="\r\n").writerows(lines)
        yield text.getvalue()
        lines = list(islice(cells, LINES))


def write_json(data: Any) -> Iterator[str]:
    """Give data as text that people can read."""
    yield json.dumps(data, cls=DjangoJSONEncoder, ensure_ascii=False, indent=2) + "\n"


class ZipResponse(StreamingHttpResponse):
    """An archive on its way. Django's own would gather all of it first when served by ASGI."""

    def __init__(self, files: Files, name: str) -> None:
        super().__init__(
            write_zip(files),
            content_type="application/zip",
            headers={
                "Content-Disposition": f'attachment; filename="{name}"',
                "Cache-Control": "no-store",
            },
        )

    async def __aiter__(self) -> AsyncIterator[bytes]:
        """Make the next part, in the request's own thread, when the one before has gone."""
        parts: Any = self.streaming_content
        make = sync_to_async(lambda: next(parts, None))
        while (part := await make()) is not None:
            yield part
