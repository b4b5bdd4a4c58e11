"""A token that is replaced: written whole, for its owner alone, and said back only then."""

import asyncio
import json
import os
import stat
from argparse import Namespace

import pytest

from robot.connection_args import find_token_store
from robot.link import Link
from tests.support.running_client import QUICK, serving


def test_the_file_is_replaced_whole_and_closed_to_others(tmp_path):
    path = tmp_path / "token"
    path.write_text("old\n")
    path.chmod(0o644)
    link = tmp_path / "link"
    link.symlink_to(path)
    assert find_token_store(Namespace(token_file=link), print)("new")
    assert path.read_text() == "new\n"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert link.is_symlink()


def test_a_disk_that_refuses_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "token"
    said: list[str] = []
    path.write_text("old\n")

    def refuse(_file):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", refuse)
    assert not find_token_store(Namespace(token_file=path), said.append)("new")
    assert path.read_text() == "old\n"
    assert "No space left on device" in said[0]


@pytest.mark.parametrize("closed", ["the file", "its folder", None])
def test_a_file_that_cannot_be_written_is_told_of(closed, tmp_path, monkeypatch):
    path = tmp_path / "token"
    path.write_text("old\n")
    said: list[str] = []
    # Root may write everything, whatever the mode.
    refused = {"the file": path, "its folder": tmp_path}.get(closed)
    monkeypatch.setattr(os, "access", lambda place, _mode: place != refused)
    store = find_token_store(Namespace(token_file=path), said.append)
    assert (store is None) == bool(closed)
    assert len(said) == bool(closed)
    assert all(str(path) in line and "Let it write both" in line for line in said)
    assert find_token_store(Namespace(token_file=None), said.append) is None
    assert len(said) == bool(closed)


@pytest.mark.parametrize("is_kept", [True, False])
async def test_a_token_is_said_back_once_it_is_stored(is_kept):
    heard, kept = [], []

    def keep(token):
        kept.append(token)
        return is_kept

    async def handler(socket):
        heard.append(socket.request.headers["Authorization"])
        heard.append(json.loads(await socket.recv()))
        await socket.send('{"type": "welcome"}')
        if len(heard) == 2:
            await socket.send('{"type": "token", "token": "t-2"}')
            if is_kept:
                heard.append(json.loads(await socket.recv()))
            else:
                await asyncio.sleep(0.05)
            await socket.close(1001)
        await socket.wait_closed()

    async with serving(handler) as url, asyncio.timeout(5):
        hello = {"type": "hello", "version": 1}
        link = Link(url, "t-1", lambda: hello, timing=QUICK, store_token=keep)
        assert (await anext(link))["type"] == "welcome"
        assert (await anext(link))["type"] == "welcome"  # of the second connection
        await link.close()
    assert kept == ["t-2"]
    assert heard[0] == "Bearer t-1"
    assert heard[1]["rotates"] is True
    again = ["Bearer t-2" if is_kept else "Bearer t-1"]
    assert [one for one in heard[2:] if isinstance(one, str)] == again
    assert ({"type": "token", "token": "t-2"} in heard) is is_kept
