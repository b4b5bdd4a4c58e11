"""`serve` on a machine that has nothing yet: a real process, a real socket, a clean end."""

from __future__ import annotations

import re
import signal
import socket
import urllib.error
import urllib.request
from types import SimpleNamespace

import pytest
from django.core.management import CommandError, call_command

from rehab.management.commands import serve as command
from tests.support.servers import serve, try_python

pytestmark = pytest.mark.server


@pytest.fixture
def server(tmp_path):
    with serve(tmp_path, new_machine=True) as running:
        yield running


def get(port: int, path: str) -> tuple[int, str]:
    with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=20) as answer:
        return answer.status, answer.read().decode()


def test_a_new_machine_serves_tells_its_password_and_ends_clean(server):
    port, said, process = server.port, server.said, server.process
    assert f"http://127.0.0.1:{port}/" in said
    assert re.search(r"as 'pt' with the password ([a-z]{4}-){2}[a-z]{4}", said)
    status, page = get(port, "/")
    assert (status, "GARRY" in page) == (200, True)
    assert get(port, "/static/css/shared/tokens.css")[0] == 200
    assert "Sign in" in get(port, "/admin/")[1]
    with pytest.raises(urllib.error.HTTPError, match="404"):
        get(port, "/nowhere")
    process.send_signal(signal.SIGINT)
    assert process.wait(15) == 0
    assert "Traceback" not in process.stdout.read()
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind(("127.0.0.1", port))


def test_a_port_that_is_taken_is_named_with_the_cure(tmp_path):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        result = try_python(tmp_path, "manage.py", "serve", port=port)
    assert result.returncode == 1
    assert re.search(r"choose another port: GARRY_PORT=\d+ make run", result.stderr)


def test_several_servers_have_no_address_in_common(monkeypatch, settings):
    settings.HOSTED = True
    settings.ADDRESS = "10.0.0.1:8000"
    monkeypatch.setattr(command, "connection", SimpleNamespace(vendor="postgresql"))
    with pytest.raises(CommandError, match="Unset it"):
        call_command("serve", processes=2)


def test_several_servers_begin_only_where_all_their_ports_are_free(monkeypatch):
    monkeypatch.setattr(command, "check_sharing", lambda _: None)
    monkeypatch.setattr(command, "prepare_database", lambda *_: pytest.fail("begun"))
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(CommandError, match=rf"Cannot serve at 127\.0\.0\.1:{port} "):
            call_command("serve", host="127.0.0.1", port=port - 1, processes=2)


def test_a_server_reports_to_systemd_that_it_is_ready_and_that_its_loop_turns(tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(10)
        with serve(tmp_path / "garry", settings={"NOTIFY_SOCKET": str(tmp_path / "notify")}):
            states = [systemd.recv(100) for _ in range(8)]
        assert set(states) == {b"READY=1", b"WATCHDOG=1"}
