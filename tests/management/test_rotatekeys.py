"""The server's own keys: rotated, interrupted, lost and found again."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import time
from io import StringIO
from pathlib import Path

import pytest
from cryptography.fernet import InvalidToken
from django.core.management import CommandError, call_command
from django.test import Client
from django.urls import reverse

from rehab.exports.encryption import generate_key
from rehab.exports.research.dates import shift_of
from rehab.people.consent.tombstones import block_reimport, is_reimport_blocked
from rehab.people.roles import Role
from rehab.people.server_keys import Purpose, decrypt_text, encrypt_text, keys_of
from rehab.people.sign_in.factors.factors import Authenticator
from rehab.studies.models import Study
from rehab.studies.registration.allocation_secret import unseal
from tests.support.servers import ROOT, clean_environment, read_tables, run_python
from tests.support.studies import SEED, running_study

OLD = "the host's key from before, which is long enough for a server"
NEW = "the host's new key, which nobody has seen, also long enough"
LOST = "a key of a host that has lost its former one, long enough too"
SECRET, PUBLIC = generate_key()


@pytest.fixture(autouse=True)
def one_host(settings, monkeypatch) -> None:
    settings.SECRET_KEY = OLD
    settings.BACKUP_KEYS = [PUBLIC]
    monkeypatch.setattr("rehab.management.commands.rotatekeys.SETTLES_S", 0.0)


@pytest.fixture
def key(tmp_path: Path) -> Path:
    path = tmp_path / "key.txt"
    path.write_text(SECRET)
    return path


def rotate(**options) -> str:
    out = StringIO()
    call_command("rotatekeys", stdout=out, stderr=out, **options)
    return out.getvalue()


def add_app(world) -> Authenticator:
    credential = encrypt_text(Purpose.AUTHENTICATORS, "JBSWY3DP")
    kind = Authenticator.Kind.APP
    return Authenticator.everywhere.create(
        user=world.people[Role.LEAD], kind=kind, credential=credential
    )


@pytest.mark.django_db
@pytest.mark.postgres
def test_new_keys_open_all_and_the_hosts_old_one_is_not_asked_for(world, settings):
    study, app = running_study(world), add_app(world)
    block_reimport(world.clinic.pk, 7)
    call_command("rotatekeys")
    before, sealed, keys = shift_of("P-1"), study.sealed, keys_of(Purpose.STUDIES)
    settings.SECRET_KEY, settings.SECRET_KEY_FALLBACKS = NEW, [OLD]
    assert "studies: 1 encrypted again" in rotate()
    settings.SECRET_KEY_FALLBACKS = []
    study.refresh_from_db()
    app.refresh_from_db()
    assert study.sealed != sealed
    assert not set(keys) & set(keys_of(Purpose.STUDIES))
    assert unseal(study.sealed).seed == SEED
    assert decrypt_text(Purpose.AUTHENTICATORS, app.credential) == "JBSWY3DP"
    # What is hashed cannot be hashed anew: these keys stay.
    assert shift_of("P-1") == before
    assert is_reimport_blocked(world.clinic.pk, 7)
    assert not is_reimport_blocked(world.clinic.pk, 8)


@pytest.mark.django_db
def test_a_sign_in_outlives_the_hosts_key(world, settings):
    client: Client = world.pt
    assert client.get(reverse("start")).status_code == 200
    settings.SECRET_KEY, settings.SECRET_KEY_FALLBACKS = NEW, [OLD]
    assert client.get(reverse("start")).status_code == 200
    settings.SECRET_KEY_FALLBACKS = []
    assert client.get(reverse("start")).status_code == 200  # its cookie was renewed


@pytest.mark.django_db
def test_the_backups_key_opens_a_running_study_whose_host_lost_its_key(world, settings, key):
    study = running_study(world)
    rotate()
    settings.SECRET_KEY = LOST
    study.refresh_from_db()
    with pytest.raises(CommandError, match="studies 2.*--key KEYFILE"):
        rotate()
    other = key.with_name("other.txt")
    other.write_text(generate_key()[0])
    with pytest.raises(CommandError, match="do not open"):
        rotate(key=other)
    rotate(key=key)
    assert unseal(Study.everywhere.get(pk=study.pk).sealed).seed == SEED


@pytest.mark.django_db
def test_without_a_copy_a_new_secret_is_sealed_all_the_same(world, settings):
    study = running_study(world)
    settings.SECRET_KEY = LOST
    assert decrypt_text(Purpose.STUDIES, encrypt_text(Purpose.STUDIES, "x")) == "x"
    with pytest.raises(InvalidToken):
        decrypt_text(Purpose.STUDIES, study.sealed)
    settings.SECRET_KEY_FALLBACKS = [OLD]
    assert unseal(study.sealed).seed == SEED


SEEDED = """
from rehab.people.models import User
from rehab.people.server_keys import Purpose, encrypt_text
from rehab.people.sign_in.factors.factors import Authenticator
user = User.everywhere.create(username="h", role="host")
encrypted = encrypt_text(Purpose.AUTHENTICATORS, "JBSWY3DP")
Authenticator.everywhere.bulk_create(
    Authenticator(user=user, kind="app", credential=encrypted) for _ in range(600))
"""
OPENED = """
from rehab.people.server_keys import *
from rehab.people.server_keys import _fernet
from rehab.people.sign_in.factors.factors import Authenticator
(key,) = keys_of(Purpose.AUTHENTICATORS)
rows = Authenticator.everywhere.values_list("credential", flat=True)
print({_fernet(key).decrypt(one.encode()) for one in rows}, ServerKey.objects.count())
"""


@pytest.mark.long
@pytest.mark.server
def test_a_killed_rotation_goes_on_where_it_was(tmp_path):
    (tmp_path / "garry.sqlite3").write_bytes(read_tables())
    run_python(tmp_path, "manage.py", "shell", "-v0", "-c", SEEDED)
    database = sqlite3.connect(tmp_path / "garry.sqlite3")

    def credentials() -> set[str]:
        return {row[0] for row in database.execute("SELECT credential FROM rehab_authenticator")}

    (before,) = credentials()
    command = [sys.executable, "manage.py", "rotatekeys"]
    process = subprocess.Popen(
        command, cwd=ROOT, env=clean_environment(tmp_path, 8000), stdout=subprocess.DEVNULL
    )
    until_s = time.monotonic() + 60
    while len(credentials()) < 50 and time.monotonic() < until_s:
        time.sleep(0.005)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    half = credentials()
    database.close()
    assert before in half
    assert len(half) >= 50
    told = run_python(tmp_path, "manage.py", "rotatekeys")
    assert f"authenticators: {600 - (len(half) - 1)} encrypted again" in told
    # One key of each purpose: the rotation that was killed left none beside.
    opened = run_python(tmp_path, "manage.py", "shell", "-v0", "-c", OPENED)
    assert opened.split() == ["{b'JBSWY3DP'}", "5"]
