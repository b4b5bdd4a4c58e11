"""A clinic's own certificate authority: it vouches for one server in the clinic's network alone.

The authority's certificate is installed on phones and tablets. By its name constraints (RFC 5280,
4.2.1.10) even a stolen key vouches for no server of the internet.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from datetime import datetime, timedelta
from ipaddress import ip_address, ip_network
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from robot.atomic_file import replacing

AUTHORITY_LIFETIME = timedelta(days=3650)
# Apple's limits: 825 days for an installed authority's, 398 for a public one's.
LIFETIME = timedelta(days=397)
RENEWED_BEFORE = timedelta(days=90)
CLOCKS_DIFFER = timedelta(days=1)  # a phone's clock may be late
# Private networks (RFC 1918, 3927, 4193, 4291), this machine, and names that are never sold.
NETWORKS = (
    *("10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "169.254.0.0/16", "127.0.0.0/8"),
    *("fc00::/7", "fe80::/10", "::1/128"),
)
DOMAINS = ("local", "localhost", "internal", "home.arpa")


class OwnAuthority:
    """The authority in a folder, and the server's certificate that it issues.

    Parameters
    ----------
    folder
        Where the files are; only this account of the machine can read the keys.

    Attributes
    ----------
    certificate, server
        The authority's certificate; the server's with its key, in one file: they always belong
        together.
    """

    def __init__(self, folder: Path) -> None:
        self.certificate, self.server = folder / "authority.pem", folder / "server.pem"
        self._key, self._folder = folder / "authority.key", folder

    @property
    def exists(self) -> bool:
        """Whether it was made."""
        return self.server.exists()

    def make(self, names: Collection[str], now: datetime) -> None:
        """Make it for these names and addresses, with the server's certificate."""
        self._folder.mkdir(parents=True, exist_ok=True)
        self._folder.chmod(0o700)
        key = ec.generate_private_key(ec.SECP256R1())
        subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"GARRY {now:%Y-%m-%d}")])
        permitted = [_subtree(one) for one in (*NETWORKS, *DOMAINS, *names)]
        usage = x509.KeyUsage(*(False,) * 5, True, True, False, False)  # signs certificates
        made = (
            _begin(subject, subject, key.public_key(), now, AUTHORITY_LIFETIME)
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(usage, critical=True)
            .add_extension(x509.NameConstraints(permitted, None), critical=True)
            .sign(key, hashes.SHA256())
        )
        _write(self._key, _encode(key))
        _write(self.certificate, made.public_bytes(Encoding.PEM))
        self.issue(names, now)

    def issue(self, names: Iterable[str], now: datetime) -> None:
        """Issue the server's certificate, for those of these names that the authority may."""
        own = read_certificate(self.certificate)
        signer = load_pem_private_key(self._key.read_bytes(), None)
        assert isinstance(signer, ec.EllipticCurvePrivateKey)  # noqa: S101 (made above)
        allowed = [_name(one) for one in names if self._may(one)]
        key = ec.generate_private_key(ec.SECP256R1())
        subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "GARRY")])
        lifetime = min(LIFETIME, own.not_valid_after_utc - now)
        issuer = x509.AuthorityKeyIdentifier.from_issuer_public_key(signer.public_key())
        made = (
            _begin(subject, own.subject, key.public_key(), now, lifetime)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(x509.SubjectAlternativeName(allowed), critical=False)
            .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
            .add_extension(issuer, critical=False)
            .sign(signer, hashes.SHA256())
        )
        _write(self.server, made.public_bytes(Encoding.PEM) + _encode(key))

    def renew(self, names: Iterable[str], now: datetime) -> bool:
        """Issue a new certificate if the server's ends soon or lacks a name; return whether."""
        there = read_certificate(self.server)
        wanted = {one for one in names if self._may(one)}
        if wanted <= {*names_of(there)} and there.not_valid_after_utc - now > RENEWED_BEFORE:
            return False
        self.issue(sorted(wanted | {*names_of(there)}), now)
        return True

    def _may(self, text: str) -> bool:
        """Return whether the authority may vouch for a name or address."""
        extensions, name = read_certificate(self.certificate).extensions, _name(text).value
        limits = extensions.get_extension_for_class(x509.NameConstraints).value
        for subtree in limits.permitted_subtrees or ():
            within = subtree.value
            if isinstance(name, str) and isinstance(within, str):
                if f".{name}".endswith(f".{within}"):
                    return True
            elif not isinstance(name, str) and not isinstance(within, str) and name in within:
                return True
        return False


def read_certificate(file: Path) -> x509.Certificate:
    """Return the first certificate of a PEM file. Raises OSError or ValueError."""
    return x509.load_pem_x509_certificates(file.read_bytes())[0]


def names_of(certificate: x509.Certificate) -> list[str]:
    """Return the names and addresses that a certificate is for."""
    try:
        found = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName)
    except x509.ExtensionNotFound:
        return []
    names = found.value.get_values_for_type(x509.DNSName)
    return [*names, *map(str, found.value.get_values_for_type(x509.IPAddress))]


def fingerprint(certificate: x509.Certificate) -> str:
    """Return the SHA-256 of a certificate, as phones show it."""
    return certificate.fingerprint(hashes.SHA256()).hex(":").upper()


def _begin(
    subject: x509.Name,
    issuer: x509.Name,
    key: ec.EllipticCurvePublicKey,
    now: datetime,
    lifetime: timedelta,
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - CLOCKS_DIFFER)
        .not_valid_after(now + lifetime)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key), critical=False)
    )


def _name(text: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_address(text))
    except ValueError:
        return x509.DNSName(text)


def _subtree(text: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_network(text))
    except ValueError:
        return x509.DNSName(text)


def _encode(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


def _write(file: Path, data: bytes) -> None:
    """Write a file that only this account reads, whole or not at all."""
    with replacing(file) as out:
        out.write(data)
