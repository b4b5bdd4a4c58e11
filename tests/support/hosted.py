"""A hosted set of its own on loopback, in a folder: PostgreSQL, and HAProxy with TLS before GARRY.

Services that run on the machine already are not touched.
"""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import socket
import ssl
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from ipaddress import IPv4Address
from pathlib import Path
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from tests.support.servers import ROOT, free_port

NAME = "localhost"
DEPLOY = ROOT / "deploy"
PASSWORD = "only on loopback, for a minute"


def find_missing() -> str:
    """Return what the set needs and this machine lacks, with the cure; empty where it is there."""
    programs = {
        "haproxy": find_haproxy(),
        "postgresql": find_initdb(),
    }
    lacking = [package for package, program in programs.items() if program is None]
    return f"apt-get install {' '.join(lacking)}" if lacking else ""


def find_haproxy() -> str | None:
    """Return HAProxy, which Debian keeps where only root looks."""
    return shutil.which("haproxy", path=f"{os.environ['PATH']}:/usr/sbin")


def find_initdb() -> Path | None:
    """Return the newest PostgreSQL's initdb."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    return found[-1] if found else None


Restarts = dict[str, Callable[[], None]]  # by program: kills it and starts it again
REVIVE_POSTGRES = "postgres that ended"  # starts it where it gave up by itself, as systemd does


@contextmanager
def run_postgres(
    restarts: Restarts | None = None,
    *,
    disk: Path | None = None,
    variables: dict[str, str] | None = None,
    settings: str = "",
) -> Iterator[str]:
    """Run a PostgreSQL of our own until the block ends; yield the address of its database.

    It refuses to run as root, so then it runs as somebody else, in a folder that is theirs.

    Parameters
    ----------
    restarts
        Gets what kills it and starts it again.
    disk
        Where its folder is made, else among the temporary ones.
    variables
        Environment variables of its own.
    settings
        Of its own, as on its command line: ``-c commit_delay=500``.
    """
    with tempfile.TemporaryDirectory(prefix="garry-postgres-", dir=disk) as name:
        yield from _run_postgres(
            Path(name), {} if restarts is None else restarts, variables, settings
        )


def _run_postgres(
    folder: Path, restarts: Restarts, variables: dict[str, str] | None, settings: str
) -> Iterator[str]:
    bin_folder = find_initdb().parent
    port = free_port()
    data, sockets = folder / "data", folder / "sockets"
    sockets.mkdir()
    secret = folder / "password"
    secret.write_text(PASSWORD)
    account: dict[str, Any] = {}
    if os.geteuid() == 0:
        other = pwd.getpwnam("postgres")
        account = {"user": other.pw_uid, "group": other.pw_gid, "extra_groups": []}
        for path in (folder, sockets, secret):
            os.chown(path, other.pw_uid, other.pw_gid)
    made = subprocess.run(
        [
            *(bin_folder / "initdb", "--pgdata", data, "--username=garry", f"--pwfile={secret}"),
            *("--auth=scram-sha-256", "--encoding=UTF8", "--locale=C", "--no-sync"),
        ],
        capture_output=True,
        text=True,
        cwd="/",
        **account,
    )
    assert made.returncode == 0, made.stderr
    options = (
        f"-p {port} -c listen_addresses=127.0.0.1 -c unix_socket_directories={sockets} {settings}"
    )

    def start() -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [bin_folder / "postgres", "-D", data, *options.split()],
            cwd="/",
            env=os.environ | (variables or {}),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            **account,
        )

    server = start()

    def restart() -> None:
        server.send_signal(signal.SIGQUIT)  # at once, as in a crash: it recovers from its log
        server.wait(30)
        start_again()

    def start_again() -> None:
        nonlocal server
        for _ in range(100):  # not while a process of the old one has its memory still
            server = start()
            time.sleep(0.2)
            if server.poll() is None:
                break
        _wait_for_postgres(bin_folder, port)

    def revive() -> None:
        if server.poll() is not None:
            start_again()

    restarts["postgres"] = restart
    restarts[REVIVE_POSTGRES] = revive
    try:
        _wait_for_postgres(bin_folder, port)
        _make_database(port)
        yield _address(port, "garry")
    finally:
        server.send_signal(signal.SIGINT)  # it waits for no client
        server.wait(30)


def _wait_for_postgres(bin_folder: Path, port: int) -> None:
    ready = [str(bin_folder / "pg_isready"), "-q", "-h", "127.0.0.1", "-p", str(port), "-t", "1"]
    for _ in range(240):
        if subprocess.run(ready).returncode == 0:
            return
        time.sleep(0.25)  # it says at once that it recovers from its log
    raise RuntimeError("PostgreSQL does not answer")


def wait_for_port(port: int) -> None:
    """Wait until something listens at a port."""
    for _ in range(200):
        try:
            socket.create_connection(("127.0.0.1", port), 1).close()
        except ConnectionRefusedError:
            time.sleep(0.05)
        else:
            return
    raise RuntimeError(f"Nobody listens at port {port}")


def _make_database(port: int) -> None:
    import psycopg

    with psycopg.connect(_address(port, "postgres"), autocommit=True) as connection:
        connection.execute("CREATE DATABASE garry")


def _address(port: int, database: str) -> str:
    return f"postgres://garry:{PASSWORD.replace(' ', '%20')}@127.0.0.1:{port}/{database}"


def make_certificate(folder: Path) -> ssl.SSLContext:
    """Write a certificate for this machine with its key; return a context that trusts it."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, NAME)])
    now = datetime.now(UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(now + timedelta(days=1))
        .add_extension(
            x509.SubjectAlternativeName(
                [x509.DNSName(NAME), x509.IPAddress(IPv4Address("127.0.0.1"))]
            ),
            critical=False,
        )
        .sign(key, hashes.SHA256())
    )
    pem = certificate.public_bytes(serialization.Encoding.PEM)
    private = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    (folder / "garry.pem").write_bytes(pem + private)
    return ssl.create_default_context(cadata=pem.decode())


def adapt(text: str, changes: dict[str, str]) -> str:
    """Return a file of deploy/ with what docs/hosting.md says to change. Each is in it."""
    for old, new in changes.items():
        assert old in text, f"deploy/ has no {old!r} any more"
        text = text.replace(old, new)
    return text


@contextmanager
def run_haproxy(
    folder: Path, *server_ports: int, restarts: Restarts | None = None
) -> Iterator[tuple[str, str, ssl.SSLContext]]:
    """Run HAProxy before one or two servers until the block ends, by the configuration we ship.

    Yields its addresses with and without TLS, and a context that trusts it. ``folder``/log has
    what it logs.
    """
    folder.mkdir()
    plain, secure = free_port(), free_port()
    tls = make_certificate(folder)
    second = server_ports[-1] if server_ports[1:] else free_port()
    text = adapt(
        (DEPLOY / "haproxy" / "haproxy.cfg").read_text(),
        {
            "log /dev/log local0": "log stdout format raw local0",
            "    chroot /var/lib/haproxy\n    user haproxy\n    group haproxy\n": "",
            "/etc/haproxy/garry.pem": str(folder / "garry.pem"),
            "127.0.0.1:8000": f"127.0.0.1:{server_ports[0]}",
            "127.0.0.1:8001": f"127.0.0.1:{second}",
            "maxconn 20000": "maxconn 2000",  # as many files as a test may open
            "bind :80": f"bind 127.0.0.1:{plain}",
            "bind :443": f"bind 127.0.0.1:{secure}",
        },
    )
    (folder / "haproxy.cfg").write_text(text)
    command = [find_haproxy(), "-f", str(folder / "haproxy.cfg")]
    tried = subprocess.run([*command, "-c"], capture_output=True, text=True)
    assert tried.returncode == 0, tried.stderr
    assert "WARNING" not in tried.stderr, tried.stderr

    def start() -> subprocess.Popen[bytes]:
        with (folder / "log").open("a") as log:
            return subprocess.Popen(command, stdout=log, stderr=log)

    server = start()

    def restart() -> None:
        nonlocal server
        server.kill()
        server.wait(10)
        server = start()
        wait_for_port(secure)

    if restarts is not None:
        restarts["haproxy"] = restart
    try:
        wait_for_port(secure)
        yield f"http://{NAME}:{plain}", f"https://{NAME}:{secure}", tls
    finally:
        server.kill()
        server.wait(10)
