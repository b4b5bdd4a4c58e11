"""https in a clinic's own network: its certificate, its pages, and what http does then."""

from __future__ import annotations

import ssl
import stat
import subprocess
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from cryptography import x509
from django.test import Client

from rehab.stations.https.authority import (
    LIFETIME,
    RENEWED_BEFORE,
    OwnAuthority,
    names_of,
    read_certificate,
)
from rehab.stations.https.certificate import find_certificate, own_authority, secure_host
from tests.support.world import World

NOW = datetime(2026, 11, 24, 9, tzinfo=UTC)
NAMES = ["192.168.1.20", "clinic-pc", "clinic-pc.local"]
STRANGERS = ("https://evil.example/", "//evil.example/", "javascript:alert(1)")


@pytest.fixture
def authority(tmp_path: Path) -> OwnAuthority:
    made = OwnAuthority(tmp_path / "https")
    made.make(NAMES, NOW)
    return made


def verify(authority: OwnAuthority, host: str) -> int:
    """Return how OpenSSL, which phones' browsers agree with, judges a server of that name."""
    kind = "-verify_ip" if host[0].isdigit() else "-verify_hostname"
    at = str(int(NOW.timestamp()))
    files = ["-CAfile", str(authority.certificate), str(authority.server)]
    command = ["openssl", "verify", "-purpose", "sslserver", "-attime", at, kind, host, *files]
    return subprocess.run(command, capture_output=True, check=False).returncode


def test_it_vouches_for_this_server_alone(authority):
    assert [verify(authority, name) for name in NAMES] == [0, 0, 0]
    assert verify(authority, "192.168.1.21") != 0
    authority.issue([*NAMES, "bank.example", "8.8.8.8"], NOW)
    assert sorted(names_of(read_certificate(authority.server))) == sorted(NAMES)


def test_browsers_refuse_what_a_stolen_key_would_sign(authority, monkeypatch):
    monkeypatch.setattr(OwnAuthority, "_may", lambda *_: True)
    authority.issue(["bank.example"], NOW)
    assert verify(authority, "bank.example") != 0


def test_only_this_account_reads_the_keys(authority):
    folder = authority.server.parent
    modes = {one.name: stat.S_IMODE(one.stat().st_mode) for one in folder.iterdir()}
    assert modes == {"authority.pem": 0o600, "authority.key": 0o600, "server.pem": 0o600}
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_it_is_renewed_in_time_and_for_a_new_address(authority):
    before = authority.server.read_bytes()
    assert not authority.renew(NAMES, NOW)
    assert authority.renew([*NAMES, "192.168.1.44"], NOW)
    assert "192.168.1.44" in names_of(read_certificate(authority.server))
    later = NOW + LIFETIME - RENEWED_BEFORE + timedelta(hours=1)
    assert authority.renew(NAMES, later)
    assert read_certificate(authority.server).not_valid_after_utc == later + LIFETIME
    assert authority.server.read_bytes() != before
    assert not authority.renew(["bank.example"], later)  # never for what it may not


def test_what_apple_asks_for(authority):
    """Apple's requirements for TLS servers: names as SAN, purpose, at most 825 days, SHA-2."""
    server = read_certificate(authority.server)
    assert server.not_valid_after_utc - server.not_valid_before_utc <= timedelta(days=825)
    assert server.signature_hash_algorithm.name == "sha256"
    purpose = server.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert [one.dotted_string for one in purpose] == ["1.3.6.1.5.5.7.3.1"]


@pytest.fixture
def lead(world: World) -> Client:
    return world.lead


@pytest.fixture
def clinic_folder(settings, tmp_path, monkeypatch):
    settings.DATA_DIR = tmp_path
    monkeypatch.setattr("rehab.stations.pages.https.network_address", lambda: "192.168.1.20")
    return tmp_path


@pytest.mark.django_db
def test_the_lead_makes_it_on_a_page(lead: Client, pt: Client, clinic_folder):
    assert "Create it" in lead.get("/https/").content.decode()
    assert "Your clinic’s lead does this." in pt.get("/https/").content.decode()
    pt.post("/https/")
    assert find_certificate() is None
    page = lead.post("/https/", follow=True).content.decode()
    assert f"http://{secure_host()}/certificate/" in page
    before = own_authority().server.read_bytes()
    lead.post("/https/")
    assert own_authority().server.read_bytes() == before  # phones trust it


@pytest.mark.django_db
def test_without_a_network_nothing_is_made(lead: Client, clinic_folder, monkeypatch):
    monkeypatch.setattr("rehab.stations.pages.https.network_address", lambda: None)
    assert "Connect it to the clinic’s network first" in lead.post("/https/").content.decode()
    assert find_certificate() is None


@pytest.mark.django_db
def test_it_leads_back_to_the_page_that_led_there(lead: Client, pt: Client, clinic_folder):
    trial = "/first-steps/phone/"
    page = pt.post(f"/https/?next={trial}").content.decode()  # who may not make one
    assert f'href="{trial}"' in page
    for stranger in STRANGERS:
        assert lead.post(f"/https/?next={stranger}").headers["Location"] == "/https/"
        own_authority().server.unlink()
    assert lead.post(f"/https/?next={trial}").headers["Location"] == trial


@pytest.mark.django_db
def test_a_phone_gets_it_by_http(client: Client, lead: Client, clinic_folder):
    assert client.get("/certificate/garry.crt").status_code == 404
    assert "no certificate yet" in client.get("/certificate/").content.decode()
    lead.post("/https/")
    away: Any = {"REMOTE_ADDR": "192.168.1.50"}
    page = client.get("/certificate/", **away).content.decode()
    assert "Certificate Trust Settings" in page
    for agent, unfolded in (("Android", 1), ("(Mac OS X)", 2), ("", 3)):
        named = client.get("/certificate/", headers={"user-agent": agent}, **away)
        assert named.content.decode().count(" open>") == unfolded
    file = client.get("/certificate/garry.crt", **away)
    assert file.headers["Content-Type"] == "application/x-x509-ca-cert"
    assert b"PRIVATE" not in file.content
    ssl.create_default_context(cadata=file.content.decode())


@pytest.mark.django_db
def test_http_leads_others_to_https(client: Client, lead: Client, clinic_folder, settings):
    away: Any = {"REMOTE_ADDR": "192.168.1.50"}
    assert client.get("/sign-in/", **away).status_code == 200
    lead.post("/https/")
    moved = client.get("/sign-in/?next=/start/", **away)
    assert moved.headers["Location"] == "https://testserver:8443/sign-in/?next=/start/"
    assert client.post("/sign-in/", **away).status_code == 403
    # A browser may not trust the certificate yet: its page says so, and goes on where it does.
    asked = {"HTTP_ACCEPT": "text/html,*/*", "HTTP_HOST": "192.168.1.20:8000"} | away
    settings.ALLOWED_HOSTS = ["192.168.1.20", "testserver"]
    there = client.get("/tablet/", **asked).headers["Location"]
    assert there == "http://192.168.1.20:8443/certificate/?next=%2Ftablet%2F"
    page = client.get(there, **asked).content.decode()
    assert f'href="https://{secure_host()}/tablet/"' in page
    assert "data-goes-on" in page
    for stranger in STRANGERS:
        page = client.get("/certificate/", {"next": stranger}, **away).content.decode()
        assert "data-goes-on" not in page
        assert stranger not in page
    for own in ("127.0.0.1", "::1"):  # on this machine nothing changes
        assert client.get("/sign-in/", REMOTE_ADDR=own).status_code == 200


@pytest.mark.django_db
def test_cookies_of_https_stay_there_and_nobody_is_locked_out(client: Client, clinic_folder):
    plain, secure = client.get("/sign-in/"), client.get("/sign-in/", secure=True)
    assert not plain.cookies["csrftoken"]["secure"]
    assert secure.cookies["csrftoken"]["secure"]
    assert "Strict-Transport-Security" not in secure.headers


@pytest.mark.django_db
def test_a_phones_square_leads_to_https(pt: Client, lead: Client, world: World, clinic_folder):
    wish = {"station": world.add_station().pk, "side": "left"}
    assert 'href="/https/"' in pt.get("/phones/pair/").content.decode()
    lead.post("/https/")
    page = pt.post("/phones/pair/", wish).content.decode()
    assert "secure address" not in page
    assert f"http://{secure_host()}/certificate/" in page
