"""The command line: its help for newcomers, and errors that name a command as it is typed here."""

from __future__ import annotations

import re
import shutil
import socket
import sys

import pytest
from django.core.management import CommandError, get_commands

from garry_site.__main__ import main
from garry_site.environment import name_program
from rehab.exports.encryption import InvalidKey, read_recipients
from rehab.management.commands.serve import check_port
from rehab.people.commands import as_typed_here


@pytest.mark.parametrize(
    ("is_installed", "program", "key", "serve", "doctor"),
    [
        (True, "garry", "`garry backupkey`", r"\d garry serve\.", "`garry doctor`"),
        (
            False,
            "./manage.py",
            r"`\./manage\.py backupkey`",
            r"\d make run\.",
            "`./manage.py doctor`",
        ),
    ],
    ids=["package", "checkout"],
)
def test_texts_name_commands_that_are_here(settings, is_installed, program, key, serve, doctor):
    settings.PROGRAM, settings.IS_INSTALLED = program, is_installed
    with pytest.raises(InvalidKey, match=key):
        read_recipients([])
    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(CommandError, match=serve):
        check_port("127.0.0.1", taken.getsockname()[1])
    page = "`make run`, `manage.py doctor`, `.venv/bin/python manage.py doctor`: http://127.0.0.1:8000/"
    told = as_typed_here(page, "https://clinic.example")
    assert told.count(doctor) == 2
    assert ("make run" in told) != is_installed
    assert told.endswith("https://clinic.example/")


@pytest.mark.parametrize(
    ("prefix", "is_on_path", "program"),
    [
        ("/srv/venv", True, "garry"),
        ("/srv/venv", False, "/srv/venv/bin/garry"),
        ("/srv/uv/archive-v0/x9", True, "uvx --from 'garry[server]' garry"),
    ],
    ids=["path", "environment", "uvx"],
)
def test_the_package_s_program_is_named_as_it_can_be_typed(
    monkeypatch, prefix, is_on_path, program
):
    monkeypatch.setattr(sys, "prefix", prefix)
    monkeypatch.setattr(shutil, "which", lambda name: f"/bin/{name}" if is_on_path else None)
    assert name_program(is_installed=True) == program


@pytest.mark.parametrize("words", [[], ["help"], ["--help"], ["-h"]], ids=str)
def test_its_help_is_short_and_names_commands_that_exist(monkeypatch, capsys, words):
    monkeypatch.setattr(sys, "argv", ["/usr/bin/garry", *words])
    main()
    said = capsys.readouterr().out
    named = re.findall(r"^  (\w+) ", said, re.MULTILINE)
    assert named[:2] == ["serve", "demo"]
    assert set(named) <= get_commands().keys()
    assert len(said.splitlines()) < 12
    assert "garry help --all" in said
    assert "django" not in said.lower()


def test_all_commands_are_listed_to_who_asks(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["garry", "help", "--all"])
    main()
    assert {"serve", "makemigrations", "rotatekeys"} <= set(capsys.readouterr().out.split())
