"""What `manage.py serve` refuses before anything is started."""

from __future__ import annotations

import socket

import pytest
from django.core.management import CommandError, call_command

from rehab.management.commands import serve


def test_several_servers_begin_only_where_all_their_ports_are_free(monkeypatch):
    monkeypatch.setattr(serve, "check_sharing", lambda _: None)
    monkeypatch.setattr(serve, "prepare_database", lambda: pytest.fail("begun"))
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(CommandError, match=rf"Cannot serve at 127\.0\.0\.1:{port} "):
            call_command("serve", host="127.0.0.1", port=port - 1, processes=2)
