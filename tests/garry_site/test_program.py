"""An error names a command as it is typed on this installation."""

from __future__ import annotations

import socket

import pytest
from django.core.management import CommandError

from rehab.exports.encryption import InvalidKey, read_recipients
from rehab.management.commands.serve import check_port


@pytest.mark.parametrize(
    ("program", "key", "serve"),
    [
        ("garry", "`garry backupkey`", r"\d garry serve\."),
        ("manage.py", r"`manage\.py backupkey`", r"\d make run\."),
    ],
    ids=["package", "checkout"],
)
def test_errors_name_commands_that_are_here(settings, program, key, serve):
    settings.PROGRAM = program
    with pytest.raises(InvalidKey, match=key):
        read_recipients([])
    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(CommandError, match=serve):
        check_port("127.0.0.1", taken.getsockname()[1])
