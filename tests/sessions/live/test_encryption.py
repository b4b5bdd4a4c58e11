"""https beside http: what a certificate that comes later begins."""

import asyncio
from types import SimpleNamespace

from rehab.sessions.live import https_port


async def test_the_port_is_opened_once_however_often_the_certificate_is_renewed(monkeypatch):
    opened, looks, done = [], [], asyncio.Event()

    def find_certificate():
        looks.append(1)
        if len(looks) > 3:
            done.set()
        return "files" if len(looks) > 1 else None

    reactor = SimpleNamespace(listenTCP=lambda *_, **__: opened.append(len(looks)))
    monkeypatch.setattr(https_port, "get_reactor", lambda: reactor)
    monkeypatch.setattr(https_port, "find_certificate", find_certificate)
    for name in ("_CurrentContext", "_EitherFactory", "answer_to_names", "keep_current"):
        monkeypatch.setattr(https_port, name, lambda *_: None)
    monkeypatch.setattr(https_port, "LOOK_S", 0.0)
    monkeypatch.setattr(https_port, "RENEW_S", 0.0)
    task = asyncio.create_task(https_port.encrypt(None, asyncio.Event()))
    await asyncio.wait_for(done.wait(), 5)
    task.cancel()
    assert opened == [2]
