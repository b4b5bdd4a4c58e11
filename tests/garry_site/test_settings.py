"""Every misconfiguration has an id, a sentence and a cure."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from django.contrib.auth.hashers import make_password
from django.core.checks import CheckMessage, run_checks
from django.core.management import get_commands

from garry_site import settings as own_settings
from tests.support.servers import run_python, try_python

HOSTED: dict[str, Any] = {
    "GARRY_HOSTED": "1",
    "GARRY_SECRET_KEY": "k" * 25 + "0123456789" * 5,
    "GARRY_ALLOWED_HOSTS": "garry.example",
    "GARRY_DATABASE_URL": "postgres://garry@127.0.0.1/garry",
}


def check(tmp_path: Path, *arguments: str, **variables: Any) -> tuple[int, str]:
    """Run `manage.py check` as an operator would, with nothing but these variables."""
    result = try_python(tmp_path, "manage.py", "check", *arguments, **variables)
    return result.returncode, result.stdout + result.stderr


@pytest.mark.server
def test_one_machine_needs_no_setting(tmp_path):
    code, said = check(tmp_path, "--fail-level", "ERROR")
    assert code == 0, said
    assert (tmp_path / "secret_key").stat().st_mode & 0o777 == 0o600


@pytest.mark.server
def test_the_hosted_settings_pass_the_deployment_checks(tmp_path):
    code, said = check(tmp_path, "--deploy", "--fail-level", "WARNING", **HOSTED)
    assert code == 0, said


@pytest.mark.server
@pytest.mark.parametrize(
    ("variables", "said"),
    [
        ({"GARRY_DATABASE_URL": "sqlite:////tmp/garry-never.sqlite3"}, "garry.E004"),
        ({"GARRY_PROT": "8001"}, "garry.W008"),
        ({"GARRY_PORT": "eighty"}, "whole number from 1 to 65535"),
        ({"GARRY_HOSTED": "maybe"}, "neither yes nor no"),
        ({"GARRY_METRICS_TOKEN": "a_token     # for Prometheus"}, "lines of their own"),
        ({"GARRY_TIME_ZONE": "Mars/Base"}, "no time zone"),
        ({"GARRY_LOG_LEVEL": "LOUD"}, "GARRY_LOG_LEVEL must be"),
        ({"GARRY_DATABASE_URL": "nonsense"}, "GARRY_DATABASE_URL"),
    ],
)
def test_a_wrong_hosted_setting_is_named_with_its_cure(tmp_path, variables, said):
    code, output = check(tmp_path, "--deploy", "--fail-level", "WARNING", **HOSTED | variables)
    assert code != 0
    assert said in output


SERVERS = {
    "daphne": ("-m", "daphne", "garry_site.asgi:application", "--port", "0"),
    "serve": ("manage.py", "serve"),
}
UNSAFE: dict[str, tuple[dict[str, Any], str]] = {
    "without a key": ({"GARRY_SECRET_KEY": ""}, "needs a secret key of its own"),
    "with a short key": ({"GARRY_SECRET_KEY": "k" * 49}, "50 or more random characters"),
    "with debug pages": ({"GARRY_DEBUG": "1"}, "must not show debug pages"),
    "without names": ({"GARRY_ALLOWED_HOSTS": ""}, "must know its own names"),
    "with every name": ({"GARRY_ALLOWED_HOSTS": "*"}, "must know its own names"),
}


@pytest.mark.server
@pytest.mark.parametrize(
    ("server", "fault"),
    [
        ("serve", "without a key"),
        *(("daphne", one) for one in UNSAFE),
    ],
)
def test_no_server_command_starts_a_hosted_server_that_strangers_could_enter(
    tmp_path, server, fault
):
    variables, said = UNSAFE[fault]
    started = try_python(tmp_path, *SERVERS[server], **HOSTED | variables)
    assert started.returncode != 0
    assert said in started.stderr


def ids(messages: list[CheckMessage]) -> set[str | None]:
    return {message.id for message in messages if str(message.id).startswith("garry.")}


def test_a_data_folder_that_cannot_be_written_is_named(settings, tmp_path):
    settings.DATA_DIR = tmp_path / "absent"
    assert "garry.E006" in ids(run_checks())


def test_a_folder_that_others_of_the_machine_can_open_is_named(settings, tmp_path):
    settings.DATA_DIR = tmp_path / "var"
    settings.DATA_DIR.mkdir()
    for mode, is_named in ((0o700, False), (0o710, True), (0o755, True)):
        settings.DATA_DIR.chmod(mode)
        assert ("garry.E011" in ids(run_checks())) == is_named, oct(mode)


def test_a_database_elsewhere_that_others_of_the_machine_can_read_is_named(
    settings, tmp_path, monkeypatch
):
    database = tmp_path / "open" / "garry.sqlite3"
    database.parent.mkdir()
    database.parent.chmod(0o755)
    database.touch()
    monkeypatch.setitem(settings.DATABASES["default"], "ENGINE", "django.db.backends.sqlite3")
    monkeypatch.setitem(settings.DATABASES["default"], "NAME", str(database))
    for mode, is_named in ((0o600, False), (0o644, True)):
        database.chmod(mode)
        assert ("garry.E011" in ids(run_checks())) == is_named, oct(mode)


def test_missing_browser_libraries_are_named(settings, tmp_path):
    settings.BROWSER_LIBRARIES = {"uplot": tmp_path / "absent"}
    assert "garry.W007" in ids(run_checks())


def test_a_server_that_answers_to_every_name_is_named(settings):
    settings.ALLOWED_HOSTS = ["*"]
    assert "garry.W003" in ids(run_checks())


def test_our_commands_come_before_daphnes():
    assert get_commands()["runserver"] == "rehab"


def test_passwords_are_kept_by_argon2(settings):
    settings.PASSWORD_HASHERS = own_settings.PASSWORD_HASHERS  # not the quick ones of tests
    assert make_password("walk well 2026").startswith("argon2$argon2id$")


LOOK_AT_SQLITE = """
import django, json
django.setup()
from django.db import connection
with connection.cursor() as cursor:
    names = ("journal_mode", "synchronous", "foreign_keys")
    print(json.dumps({name: cursor.execute(f"PRAGMA {name}").fetchone()[0] for name in names}))
"""


def look_at_sqlite(folder: Path) -> str:
    """Open the database of a data folder in a process of its own; return what it says."""
    return run_python(folder, "-c", LOOK_AT_SQLITE, umask=0o022)


@pytest.mark.server
@pytest.mark.parametrize("exists", [False, True])
def test_nobody_else_of_the_machine_can_read_what_is_stored(tmp_path, exists):
    folder = tmp_path / "var"
    if exists:  # made by a version that left it open
        folder.mkdir()
        folder.chmod(0o755)
    look_at_sqlite(folder)
    files = [folder, *folder.iterdir()]
    assert folder / "garry.sqlite3" in files
    assert [file.name for file in files if file.stat().st_mode & 0o077] == []


@pytest.mark.server
def test_sqlite_writes_each_commit_through_to_the_disk(tmp_path):
    assert json.loads(look_at_sqlite(tmp_path)) == {
        "journal_mode": "wal",
        "synchronous": 2,
        "foreign_keys": 1,
    }


@pytest.mark.parametrize(
    ("host", "warns"),
    [
        *(("127.0.0.1", False), ("::1", False), ("localhost", False)),
        *(("0.0.0.0", True), ("192.168.1.5", True), ("garry.example", True)),  # noqa: S104
    ],
)
def test_an_open_address_without_tls_is_warned_of(settings, host, warns):
    settings.HOSTED, settings.HOST = False, host
    assert ("garry.W011" in [message.id for message in run_checks()]) == warns
