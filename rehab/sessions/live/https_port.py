"""https beside http, at a port of its own, as soon as this server has a certificate.

Plain http at that port is answered, too: the first byte of a connection says which it is. So who
typed the address without https still finds the page that says what to do.
"""

from __future__ import annotations

import asyncio
import logging
from typing import Any

from django.conf import settings
from django.utils import timezone
from OpenSSL import SSL
from twisted.internet.error import CannotListenError
from twisted.internet.protocol import Factory, Protocol
from twisted.internet.ssl import ContextFactory
from twisted.protocols.tls import TLSMemoryBIOFactory

from rehab.stations.https.certificate import (
    CertificateFiles,
    answer_to_names,
    find_certificate,
    keep_current,
)

log = logging.getLogger(__name__)

HANDSHAKE = b"\x16"  # begins each TLS connection (RFC 8446, 5.1)
FIRST_BYTE_S = 20.0
LOOK_S = 1.0  # between looks whether there is a certificate by now
RENEW_S = 3600.0
EVERYWHERE = "0.0.0.0"  # noqa: S104  (phones come from the clinic's network)


class BadCertificate(ValueError):
    """Files that nothing can be encrypted with; the message says the cure."""


def make_context(files: CertificateFiles) -> SSL.Context:
    """Return what encrypts with these files. Raises BadCertificate."""
    context = SSL.Context(SSL.TLS_SERVER_METHOD)
    context.set_min_proto_version(SSL.TLS1_2_VERSION)
    try:
        context.use_certificate_chain_file(str(files.certificate))
        context.use_privatekey_file(str(files.key))
        context.check_privatekey()
    except SSL.Error as problem:
        why = problem.args[0][0][2] if problem.args and problem.args[0] else "unreadable"
        raise BadCertificate(
            f"{files.certificate} and {files.key} are no certificate with its key ({why}). Give "
            "readable PEM files that belong together (GARRY_CERTIFICATE, GARRY_CERTIFICATE_KEY)."
        ) from None
    return context


class _CurrentContext(ContextFactory):
    """Reads the certificate again once its files have changed, as after a renewal."""

    def __init__(self, files: CertificateFiles) -> None:
        self._files = files
        self._changed = self._look()
        self._context = make_context(files)

    def _look(self) -> tuple[float, ...]:
        return tuple(one.stat().st_mtime for one in self._files)

    def getContext(self) -> SSL.Context:  # noqa: N802 (Twisted's name)
        """Return what encrypts the next connection."""
        try:
            if (changed := self._look()) != self._changed:
                self._changed, self._context = changed, make_context(self._files)
        except (OSError, BadCertificate) as problem:
            log.error("The earlier certificate is used on: %s", problem)
        return self._context


class _FirstByte(Protocol):
    """Hands a connection over to TLS or to plain http, by its first byte."""

    transport: Any

    def __init__(self, plain: Any, encrypted: Any) -> None:
        self._plain, self._encrypted = plain, encrypted
        self._timeout: Any = None

    def connectionMade(self) -> None:  # noqa: N802
        """Wait for the first byte, not forever."""
        self._timeout = get_reactor().callLater(FIRST_BYTE_S, self.transport.abortConnection)

    def dataReceived(self, data: bytes) -> None:  # noqa: N802
        """Hand the connection over."""
        self._timeout.cancel()
        chosen = self._encrypted if data.startswith(HANDSHAKE) else self._plain
        protocol = chosen.buildProtocol(self.transport.getPeer())
        self.transport.protocol = protocol
        protocol.makeConnection(self.transport)
        protocol.dataReceived(data)

    def connectionLost(self, reason: Any = None) -> None:  # noqa: N802
        """End before the first byte."""
        if self._timeout.active():
            self._timeout.cancel()


class _EitherFactory(Factory[_FirstByte]):
    def __init__(self, plain: Any, context: Any) -> None:
        self._plain, self._encrypted = plain, TLSMemoryBIOFactory(context, False, plain)

    def buildProtocol(self, addr: Any) -> _FirstByte:  # noqa: N802
        return _FirstByte(self._plain, self._encrypted)


def get_reactor() -> Any:
    """Return the reactor that runs; imported earlier, it would be one that is not asyncio's."""
    from twisted.internet import reactor

    return reactor


async def encrypt(pages: Any, has_begun: asyncio.Event) -> None:
    """Serve pages by https once there is a certificate, and renew that in time.

    ``has_begun`` is set after the first attempt.
    """
    is_listening, problem = False, ""
    while True:
        try:
            await asyncio.to_thread(keep_current, timezone.now())
            files = find_certificate()
            if files is not None and not is_listening:
                context = _CurrentContext(files)
                answer_to_names()
                get_reactor().listenTCP(
                    settings.HTTPS_PORT, _EitherFactory(pages, context), interface=EVERYWHERE
                )
                is_listening = True
                log.warning("Pages come by https at port %s.", settings.HTTPS_PORT)
        except (OSError, ValueError, CannotListenError) as found:
            if str(found) != problem:
                problem = str(found)
                log.error("Nothing is encrypted: %s", problem)
        has_begun.set()
        await asyncio.sleep(RENEW_S if is_listening else LOOK_S)
