"""A backup and its restore: every row, on either database, all of it or nothing."""

from __future__ import annotations

import gzip
import json
import os
import re
import shutil
import sqlite3
import stat
import subprocess
import sys
import threading
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from django.apps import apps
from django.core import serializers
from django.core.management import CommandError, call_command
from django.db import connection

from rehab.exports import backup
from rehab.exports.backup import (
    EXCLUDED_MODELS,
    ExactEncoder,
    backup_models,
    read_lines,
    write_backup,
)
from rehab.exports.encryption import generate_key, read_identities, read_recipients
from rehab.people.models import Clinic, Patient, User
from rehab.people.server_keys import Purpose, ServerKey, keys_of
from rehab.sessions.log import Step
from tests.support.servers import ROOT, clean_environment
from tests.support.walks import HIT, MISS, walk
from tests.support.world import NOW, build_world

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]

SECRET, PUBLIC = generate_key()
IDENTITIES, RECIPIENTS = read_identities(SECRET), read_recipients([PUBLIC])


@pytest.fixture(autouse=True)
def public_key(settings) -> None:
    settings.BACKUP_KEYS = [PUBLIC]


@pytest.fixture
def key(tmp_path: Path) -> Path:
    path = tmp_path / "key.txt"
    path.write_text(f"# kept on a stick\n{SECRET}\n")
    return path


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "garry.backup"


def fill() -> None:
    for name in ("amber", "birch"):
        world = build_world(name)
        patient = Patient.everywhere.create(clinic=world.clinic, code="Ü-1", nickname="Zoë")
        walk(patient, "positive", [HIT, MISS, None] * 30)


def rows() -> dict[str, list[dict[str, Any]]]:
    """Return everything there is, as it is stored."""
    return {
        model._meta.label_lower: [
            json.loads(line)
            for line in serializers.serialize(
                "jsonl",
                model._base_manager.order_by("pk"),
                fields=[field.name for field in model._meta.concrete_fields],
                cls=ExactEncoder,
            ).splitlines()
        ]
        for model in backup_models()
        if model is not ServerKey  # encrypted anew each time
    }


def empty() -> None:
    """Make it a new installation again, as `migrate` leaves it."""
    call_command("flush", verbosity=0, interactive=False)


@pytest.mark.django_db(transaction=True)
def test_every_row_comes_back(file, key):
    fill()
    before, keys = rows(), keys_of(Purpose.STUDIES)
    call_command("backup", file)
    empty()
    assert rows() != before
    call_command("restore", file, key=key)
    assert rows() == before
    assert keys_of(Purpose.STUDIES) == keys
    assert all(before[name] for name in ("rehab.step", "rehab.sessionevent", "rehab.user"))
    # Numbers of new rows go on after those of the old ones.
    newest = max(row["pk"] for row in before["rehab.clinic"])
    assert Clinic.everywhere.create(name="New").pk > newest


def test_nothing_is_left_out_but_what_a_server_makes_anew():
    kept = {model._meta.label_lower for model in backup_models()}
    every = {model._meta.label_lower for model in apps.get_app_config("rehab").get_models()}
    assert every - kept == {"rehab.pairing"}
    assert not kept & EXCLUDED_MODELS


@pytest.mark.django_db(transaction=True)
def test_a_backup_is_one_moment_and_holds_nobody_up(file, monkeypatch):
    fill()
    steps = Step.everywhere.count()
    patient = Patient.everywhere.first()
    changed: list[int] = []

    def write_meanwhile(*args: Any, **options: Any) -> Any:
        if not changed:
            same = Patient.everywhere.filter(pk=patient.pk)
            changed.append(elsewhere(lambda: same.update(nickname="Changed meanwhile")))
        return serialize(*args, **options)

    serialize = serializers.serialize
    monkeypatch.setattr(serializers, "serialize", write_meanwhile)
    with file.open("wb") as out:
        counts = write_backup(out, RECIPIENTS, NOW)
    assert changed == [1]
    patient.refresh_from_db()
    assert patient.nickname == "Changed meanwhile"
    assert counts["rehab.step"] == steps
    with file.open("rb") as source:
        assert "Changed meanwhile" not in "\n".join(read_lines(source, IDENTITIES))


def elsewhere(do: Callable[[], int]) -> int:
    """Do something over a connection of its own, as a server beside the backup would."""
    done: list[int] = []

    def work() -> None:
        try:
            done.append(do())
        finally:
            connection.close()

    thread = threading.Thread(target=work)
    thread.start()
    thread.join(20)
    return done[0]


@pytest.mark.wide
def test_a_backup_writes_through_no_link(file, tmp_path):
    secret = tmp_path / "secret_key"
    secret.write_text("mine")
    file.with_name(f".{file.name}.new").symlink_to(secret)
    call_command("backup", file)
    assert secret.read_text() == "mine"
    assert not file.is_symlink()
    assert file.read_bytes().startswith(b"age-encryption.org")


def test_it_goes_into_a_new_installation_only(file, key):
    fill()
    call_command("backup", file)
    before = rows()
    with pytest.raises(CommandError, match="Restore into a new one"):
        call_command("restore", file, key=key)
    assert rows() == before


@pytest.mark.wide
@pytest.mark.django_db(transaction=True)
def test_a_damaged_one_changes_nothing(file, key):
    fill()
    call_command("backup", file)
    data = file.read_bytes()
    empty()
    fresh = rows()
    for damaged, said in (
        (data[:-1], "damaged"),
        (data[:200], "damaged"),
        (b"", "no backup of GARRY"),
        (
            data[:-70_000] + data[-60_000:] if len(data) > 70_000 else data[:-9] + bytes(9),
            "damaged",
        ),
    ):
        file.write_bytes(damaged)
        with pytest.raises(CommandError, match=said):
            call_command("restore", file, key=key)
        assert rows() == fresh


@pytest.mark.django_db(transaction=True)
def test_one_of_another_version_is_refused(file, key, monkeypatch):
    fill()
    call_command("backup", file)
    empty()
    older = [row for row in backup.tables_version() if row[0] != "rehab"]
    monkeypatch.setattr(backup, "tables_version", lambda: older)
    with pytest.raises(CommandError, match="Install that version, restore, and then update"):
        call_command("restore", file, key=key)
    assert not User.everywhere.exists()


@pytest.mark.parametrize(
    ("keys", "said"),
    [([], "manage.py backupkey"), (["age1x"], "begins with age1"), ([SECRET], "begins with age1")],
)
def test_a_backup_needs_a_public_key(file, settings, keys, said):
    settings.BACKUP_KEYS = keys
    with pytest.raises(CommandError, match=said):
        call_command("backup", file)
    assert not file.exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"", "no secret key"),
        (b"# nothing but a comment\n", "no secret key"),
        pytest.param(PUBLIC.encode(), "begins with AGE-SECRET-KEY-1", id="public"),
        (b"\xff\xfe", "no text file"),
        (None, "cannot be read"),
    ],
)
def test_a_restore_needs_a_secret_key(file, tmp_path, text, said):
    call_command("backup", file)
    given = tmp_path / "given.txt"
    if text is not None:
        given.write_bytes(text)
    with pytest.raises(CommandError, match=said):
        call_command("restore", file, key=given)


@pytest.mark.django_db(transaction=True)
def test_only_its_own_key_opens_it(file, tmp_path):
    call_command("backup", file)
    other = tmp_path / "other.txt"
    other.write_text(generate_key()[0])
    with pytest.raises(CommandError, match="encrypted to another key"):
        call_command("restore", file, key=other)


def test_what_backupkey_prints_is_a_key_file(file, tmp_path, settings, capsys):
    call_command("backupkey")
    printed = capsys.readouterr().out
    settings.BACKUP_KEYS = [re.search(r"GARRY_BACKUP_KEYS=(\S+)", printed)[1]]
    call_command("backup", file)
    with file.open("rb") as source:
        assert json.loads(next(read_lines(source, read_identities(printed))))["format"] == 1


def test_two_keys_open_the_same_backup(file, settings):
    secret, public = generate_key()
    settings.BACKUP_KEYS = [PUBLIC, public]
    call_command("backup", file)
    for each in (SECRET, secret):
        with file.open("rb") as source:
            assert len(list(read_lines(source, read_identities(each)))) > 1


@pytest.mark.skipif(shutil.which("age") is None, reason="no age here: apt-get install age")
def test_the_age_program_opens_it_without_garry(file, key):
    fill()
    call_command("backup", file)
    opened = subprocess.run(["age", "-d", "-i", key, file], capture_output=True, check=True).stdout
    header, *lines = gzip.decompress(opened).splitlines()
    assert len(lines) == sum(json.loads(header)["counts"].values())
    assert {json.loads(line)["model"] for line in lines} >= {"rehab.patient", "rehab.step"}


def test_a_backup_that_fails_leaves_the_old_one(file, monkeypatch):
    file.write_bytes(b"yesterday's")
    monkeypatch.setattr(
        "rehab.management.commands.backup.write_backup",
        lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")),
    )
    with pytest.raises(CommandError, match="No space left"):
        call_command("backup", file)
    assert file.read_bytes() == b"yesterday's"
    assert list(file.parent.iterdir()) == [file]


def test_nobody_else_on_the_machine_may_read_it(file, key):
    call_command("backup", file)
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


@pytest.mark.long
@pytest.mark.server
def test_from_one_machine_to_another(file, key, tmp_path):
    """The two commands as an administrator runs them, on SQLite, each in a process of its own."""

    def run(folder: str, *words: str) -> str:
        environment = clean_environment(tmp_path / folder, 1)
        environment["GARRY_BACKUP_KEYS"] = PUBLIC
        return subprocess.run(
            [sys.executable, "manage.py", *words],
            cwd=ROOT,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout

    prepare = (
        "from django.core.management import call_command; call_command('migrate', verbosity=0)"
    )
    fill = "from tests.support.world import build_world; build_world('amber')"
    run("old", "shell", "-v0", "-c", f"{prepare}; {fill}")
    assert "1 patients" in run("old", "backup", os.fspath(file))
    assert "1 patients" in run("new", "restore", os.fspath(file), "--key", os.fspath(key))
    counts = []
    for folder in ("old", "new"):
        database = sqlite3.connect(tmp_path / folder / "garry.sqlite3")
        counts += database.execute("SELECT count(*) FROM rehab_step").fetchone()
        database.close()
    assert counts[0] == counts[1] > 0


def test_now_stands_in_it(file, key):
    with file.open("wb") as out:
        write_backup(out, RECIPIENTS, NOW + timedelta(days=1))
    with file.open("rb") as source:
        header = json.loads(next(read_lines(source, IDENTITIES)))
    assert header["made_at"].startswith(f"{NOW + timedelta(days=1):%Y-%m-%d}")
