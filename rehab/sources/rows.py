"""Rows of text from whatever a lab runs: D-Flow, Nexus, Visual3D, a script of one's own.

Each line is a stride or a sample of raw signals, as CSV or JSON, by TCP, UDP or WebSocket.
docs/sources.md shows them.
"""

from __future__ import annotations

import asyncio
from argparse import ArgumentParser, Namespace
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, suppress

from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed, WebSocketException

from rehab.sources.intake import Address, Intake, LineReader, parse_address
from rehab.sources.intake.settings import IntakeSettings, add_signal_arguments
from rehab.sources.reporting import Notify, SourceError
from rehab.sources.source import LiveSource

RETRY_S = 1.0  # between attempts to reach a lab that is not there
SILENT_S = 5.0  # after which another sender of datagrams may take over
READ_BYTES = 64 * 1024
SENDER_TAKEN = "Another program already sends here. Stop it first."


class RowsSource(LiveSource):
    """Listens for one sender of rows, or connects to one."""

    @classmethod
    def add_arguments(cls, parser: ArgumentParser) -> None:
        """Add the options of this source to a command line."""
        where = parser.add_mutually_exclusive_group(required=True)
        where.add_argument(
            "--listen", metavar="URL", help="tcp://, udp:// or ws://127.0.0.1:9101 (0.0.0.0: all)"
        )
        where.add_argument("--connect", metavar="URL", help="tcp:// or ws://host:port of the lab")
        parser.add_argument(
            "--header", metavar="NAMES", help="comma-separated, for CSV that comes without"
        )
        add_signal_arguments(parser)

    def __init__(self, options: Namespace, notify: Notify) -> None:
        """Read the command line. Raises SourceError for an invalid address."""
        self.settings = IntakeSettings.read(options)
        self.address = (
            parse_address(options.listen)
            if options.listen
            else parse_address(options.connect, ("tcp", "ws"))
        )
        self._listens = bool(options.listen)
        self._header = (
            [name.strip() for name in options.header.split(",")] if options.header else []
        )
        self._notify = notify
        self._sender = ""

    async def read(self, intake: Intake) -> None:
        """Read rows from one sender at a time, for as long as this runs."""
        if not self._listens:
            await self._keep_connecting(intake)
        async with AsyncExitStack() as stack:
            try:
                self.address = await self._open(intake, stack)
            except OSError as problem:
                raise SourceError(
                    f"Nothing can listen at {self.address}: {problem.strerror or problem}. Stop "
                    "what does already, or take another port."
                ) from None
            self._notify(f"Listening for rows at {self.address}.")
            await asyncio.Event().wait()

    async def _open(self, intake: Intake, stack: AsyncExitStack) -> Address:
        """Start listening; return where, with a port that was 0 filled in."""
        kind, host, port = self.address
        if kind == "udp":
            loop = asyncio.get_running_loop()
            transport, _ = await loop.create_datagram_endpoint(
                lambda: _Datagrams(self._make_reader(), intake, self._notify), (host, port)
            )
            stack.callback(transport.close)
            return Address(kind, *transport.get_extra_info("sockname")[:2])
        if kind == "tcp":
            senders: set[asyncio.StreamWriter] = set()

            async def serve_tcp(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
                senders.add(writer)
                try:
                    peer = _name(writer.get_extra_info("peername"))
                    if not self._claim_sender(peer):
                        writer.write(f"{SENDER_TAKEN}\n".encode())
                        await writer.drain()
                        return
                    await self._receive_all(_read_tcp(reader), intake, peer)
                except OSError:
                    pass
                finally:
                    senders.discard(writer)
                    writer.close()

            def hang_up() -> None:  # a server's own wait_closed waits for its clients to go
                server.close()
                for sender in senders:
                    sender.close()

            server = await asyncio.start_server(serve_tcp, host, port)
            stack.callback(hang_up)
            return Address(kind, *server.sockets[0].getsockname()[:2])

        async def serve_ws(socket: ServerConnection) -> None:
            peer = _name(socket.remote_address)
            if self._claim_sender(peer):
                await self._receive_all(_read_ws(socket), intake, peer)
            else:
                await socket.send(SENDER_TAKEN)
                await socket.close(1013, SENDER_TAKEN)

        listening = await stack.enter_async_context(serve(serve_ws, host, port))
        return Address(kind, *next(iter(listening.sockets)).getsockname()[:2])

    async def _keep_connecting(self, intake: Intake) -> None:
        """Connect to a lab that serves, again and again."""
        last_problem = ""
        while True:
            try:
                if self.address.kind == "tcp":
                    reader, writer = await asyncio.open_connection(*self.address[1:])
                    stream, close = _read_tcp(reader), writer.close
                    try:
                        await self._receive_all(stream, intake, str(self.address))
                    finally:
                        close()
                else:
                    async with connect(str(self.address), proxy=None) as socket:
                        await self._receive_all(_read_ws(socket), intake, str(self.address))
                last_problem = ""
            except (OSError, WebSocketException) as problem:
                text = f"No lab answers at {self.address} ({getattr(problem, 'strerror', problem)})"
                if text != last_problem:
                    self._notify(f"{text}. Start its script; trying again every {RETRY_S:g} s.")
                last_problem = text
            await asyncio.sleep(RETRY_S)

    def _make_reader(self) -> LineReader:
        return LineReader(self._header)

    def _claim_sender(self, peer: str) -> bool:
        """Return whether this sender is the only one, and store it."""
        if self._sender:
            self._notify(
                f"{peer} wants to send as well and was turned away: {self._sender} already does. "
                "Stop one of the two."
            )
            return False
        self._sender = peer
        return True

    async def _receive_all(self, stream: AsyncIterator[bytes], intake: Intake, peer: str) -> None:
        """Read everything that one sender sends."""
        self._sender = peer
        self._notify(f"{peer} sends.")
        lines = self._make_reader()
        try:
            async for data in stream:
                _add_lines(lines, data, intake)
            _add_lines(lines, b"\n", intake)
        finally:
            self._sender = ""
            self._notify(f"{peer} sends no more.")


class _Datagrams(asyncio.DatagramProtocol):
    """Reads datagrams of whole lines from one sender, until it has been silent for a while."""

    def __init__(self, lines: LineReader, intake: Intake, notify: Notify) -> None:
        self._lines, self._intake, self._notify = lines, intake, notify
        self._peer: object = None
        self._heard_s = 0.0

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        now_s = asyncio.get_running_loop().time()
        if addr != self._peer:
            if self._peer is not None and now_s - self._heard_s < SILENT_S:
                self._intake.reject_row(
                    f"{_name(addr)} sends datagrams as well as {_name(self._peer)}, and is not "
                    "heard. Stop one of the two."
                )
                return
            self._peer = addr
            self._notify(f"{_name(addr)} sends.")
        self._heard_s = now_s
        _add_lines(self._lines, data if data.endswith(b"\n") else data + b"\n", self._intake)


def _add_lines(lines: LineReader, data: bytes, intake: Intake) -> None:
    rows, wrong = lines.read_bytes(data)
    for text in wrong:
        intake.reject_row(text)
    intake.add_rows(rows)


async def _read_tcp(reader: asyncio.StreamReader) -> AsyncIterator[bytes]:
    with suppress(ConnectionError):
        while data := await reader.read(READ_BYTES):
            yield data


async def _read_ws(socket: object) -> AsyncIterator[bytes]:
    """Yield messages as whole lines."""
    with suppress(ConnectionClosed):
        async for message in socket:  # type: ignore[attr-defined]
            yield (message.encode() if isinstance(message, str) else message) + b"\n"


def _name(peer: object) -> str:
    return f"{peer[0]}:{peer[1]}" if isinstance(peer, tuple) else str(peer)
