"""Every misconfiguration has an id, a sentence and a cure."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from django.contrib.auth.hashers import make_password
from django.core.checks import CheckMessage, run_checks

from garry_site import settings as own_settings
from tests.support.servers import ROOT, clean_environment

HOSTED = {
    "GARRY_HOSTED": "1",
    "GARRY_SECRET_KEY": "k" * 25 + "0123456789" * 5,
    "GARRY_ALLOWED_HOSTS": "garry.example",
    "GARRY_DATABASE_URL": "postgres://garry@127.0.0.1/garry",
    "GARRY_REDIS_URL": "redis://127.0.0.1:6379/0",
}


def check(tmp_path: Path, *arguments: str, **variables: str) -> tuple[int, str]:
    """Run `manage.py check` as an operator would, with nothing but these variables."""
    clean = clean_environment(tmp_path, 8000)
    del clean["GARRY_PORT"]
    result = subprocess.run(
        [sys.executable, "manage.py", "check", *arguments],
        cwd=ROOT,
        env=clean | variables,
        capture_output=True,
        text=True,
        timeout=60,
    )
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
        ({"GARRY_SECRET_KEY": ""}, "garry.E001"),
        ({"GARRY_DEBUG": "1"}, "garry.E002"),
        ({"GARRY_ALLOWED_HOSTS": ""}, "garry.E003"),
        ({"GARRY_ALLOWED_HOSTS": "*"}, "garry.E003"),
        ({"GARRY_DATABASE_URL": "sqlite:////tmp/garry-never.sqlite3"}, "garry.E004"),
        ({"GARRY_REDIS_URL": ""}, "garry.E005"),
        ({"GARRY_PROT": "8001"}, "garry.W008"),
        ({"GARRY_PORT": "eighty"}, "whole number from 1 to 65535"),
        ({"GARRY_HOSTED": "maybe"}, "neither yes nor no"),
        ({"GARRY_TIME_ZONE": "Mars/Base"}, "no time zone"),
        ({"GARRY_LOG_LEVEL": "LOUD"}, "GARRY_LOG_LEVEL must be"),
        ({"GARRY_DATABASE_URL": "nonsense"}, "GARRY_DATABASE_URL"),
    ],
)
def test_a_wrong_hosted_setting_is_named_with_its_cure(tmp_path, variables, said):
    code, output = check(tmp_path, "--deploy", "--fail-level", "WARNING", **HOSTED | variables)
    assert code != 0
    assert said in output


def ids(messages: list[CheckMessage]) -> set[str | None]:
    return {message.id for message in messages if str(message.id).startswith("garry.")}


def test_a_data_folder_that_cannot_be_written_is_named(settings, tmp_path):
    settings.DATA_DIR = tmp_path / "absent"
    assert "garry.E006" in ids(run_checks())


def test_missing_browser_libraries_are_named(settings, tmp_path):
    settings.BROWSER_LIBRARIES = {"uplot": tmp_path / "absent"}
    assert "garry.W007" in ids(run_checks())


def test_a_server_that_answers_to_every_name_is_named(settings):
    settings.ALLOWED_HOSTS = ["*"]
    assert "garry.W003" in ids(run_checks())


def test_sqlite_that_may_lose_steps_is_named(settings, monkeypatch):
    database = settings.DATABASES["default"]
    monkeypatch.setitem(database, "ENGINE", "django.db.backends.sqlite3")
    monkeypatch.setitem(database, "OPTIONS", {"init_command": "PRAGMA synchronous=OFF;"})
    assert "garry.E009" in ids(run_checks())


def test_an_order_of_applications_that_hides_our_commands_is_named(settings):
    apps = list(settings.INSTALLED_APPS)
    apps.remove("rehab")
    settings.INSTALLED_APPS = [*apps, "rehab"]
    assert "garry.E010" in ids(run_checks())


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


@pytest.mark.server
def test_sqlite_writes_each_commit_through_to_the_disk(tmp_path):
    environment = clean_environment(tmp_path, 8000)
    done = subprocess.run(
        [sys.executable, "-c", LOOK_AT_SQLITE],
        cwd=ROOT,
        env=environment | {"DJANGO_SETTINGS_MODULE": "garry_site.settings"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"journal_mode": "wal", "synchronous": 2, "foreign_keys": 1}
