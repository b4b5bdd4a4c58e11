"""A ZIP that is made while it is sent: nobody waits for all of it, and nothing holds all of it."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from collections.abc import AsyncIterator, Iterable, Iterator, Sequence
from datetime import datetime
from itertools import islice
from typing import Any

from asgiref.sync import sync_to_async
from django.core.serializers.json import DjangoJSONEncoder
from django.http import StreamingHttpResponse

from rehab.exports.tables import to_cells

PART = 64 * 1024
LINES = 500

Files = Iterable[tuple[str, Iterable[str]]]


class _Basket:
    """Keeps what the archive writes until it is taken."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self.size = 0

    def write(self, part: bytes) -> int:
        """Keep more."""
        self._parts.append(bytes(part))
        self.size += len(part)
        return len(part)

    def flush(self) -> None:
        """Do nothing: it is taken, not pushed."""

    def take(self) -> bytes:
        """Give what is there."""
        whole, self._parts, self.size = b"".join(self._parts), [], 0
        return whole


def write_zip(files: Files, now: datetime) -> Iterator[bytes]:
    """Give a ZIP of texts, part by part."""
    basket: Any = _Basket()
    with zipfile.ZipFile(basket, "w") as archive:
        for name, texts in files:
            about = zipfile.ZipInfo(name, now.timetuple()[:6])
            about.compress_type, about.external_attr = zipfile.ZIP_DEFLATED, 0o600 << 16
            with archive.open(about, "w", force_zip64=name == "steps.csv") as member:
                for text in texts:
                    member.write(text.encode())
                    if basket.size >= PART:
                        yield basket.take()
    yield basket.take()


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

    def __init__(self, files: Files, name: str, now: datetime) -> None:
        super().__init__(
            write_zip(files, now),
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
