"""The certificate that this server encrypts with, and the names that browsers reach it by."""

from __future__ import annotations

import socket
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from django.conf import settings

from rehab.stations.https.authority import OwnAuthority, names_of, read_certificate


class CertificateFiles(NamedTuple):
    """A certificate with its chain, and its key; they may be one file."""

    certificate: Path
    key: Path


def own_authority() -> OwnAuthority:
    """Return the clinic's own authority, which may not have been made yet."""
    return OwnAuthority(settings.DATA_DIR / "https")


def find_certificate() -> CertificateFiles | None:
    """Return the files to encrypt with: of a real name, else the own authority's; or None."""
    if settings.HOSTED:
        return None  # a proxy encrypts
    if settings.CERTIFICATE:
        return CertificateFiles(Path(settings.CERTIFICATE), Path(settings.CERTIFICATE_KEY))
    own = own_authority()
    return CertificateFiles(own.server, own.server) if own.exists else None


def is_encrypting() -> bool:
    """Return whether this server has a certificate."""
    return find_certificate() is not None


def secure_host() -> str | None:
    """Return the host and port that phones open by https; None without a certificate."""
    files = find_certificate()
    if files is None:
        return None
    names = names_of(read_certificate(files.certificate))
    if not settings.CERTIFICATE:  # an address works where names are not resolved
        names = [network_address() or socket.gethostname()]
    name = next((one for one in names if not one.startswith("*")), socket.gethostname())
    return f"[{name}]:{settings.HTTPS_PORT}" if ":" in name else f"{name}:{settings.HTTPS_PORT}"


def network_address() -> str | None:
    """Return this machine's address in its network; None without one. Nothing is sent."""
    with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(("192.0.2.1", 9))  # an address for documentation (RFC 5737)
        return str(probe.getsockname()[0])
    return None


def find_names() -> list[str]:
    """Return the names and addresses that browsers may reach this machine by."""
    host = socket.gethostname().lower()
    given = [one for one in settings.ALLOWED_HOSTS if one.strip("[]") and one[0] not in "*."]
    names = [network_address(), host, f"{host.split('.')[0]}.local", "127.0.0.1", "::1"]
    found = [*names, *(one.strip("[]") for one in given), *filter(None, [settings.HOST])]
    return [one for one in dict.fromkeys(found) if one and one not in {"0.0.0.0", "::"}]  # noqa: S104


def make_own(now: datetime) -> None:
    """Make the clinic's own authority and this server's certificate."""
    own_authority().make(find_names(), now)


def keep_current(now: datetime) -> None:
    """Renew the own authority's certificate where it is time, or an address has changed."""
    if not settings.CERTIFICATE and own_authority().exists:
        own_authority().renew(find_names(), now)


def answer_to_names() -> None:
    """Let pages be opened by the names that the certificate is for."""
    files = find_certificate()
    if files is not None:
        names = [f"[{one}]" if ":" in one else one for one in _pages_names(files)]
        settings.ALLOWED_HOSTS = list(dict.fromkeys([*settings.ALLOWED_HOSTS, *names]))


def _pages_names(files: CertificateFiles) -> list[str]:
    return [one.removeprefix("*") for one in names_of(read_certificate(files.certificate))]
