"""Tokens of devices and programs."""

from __future__ import annotations

import secrets

from rehab.people.sign_in.tokens import draw_token


def test_a_token_can_be_given_on_a_command_line(monkeypatch):
    drawn = iter(["-option", "--other", "a-token"])
    monkeypatch.setattr(secrets, "token_urlsafe", lambda size: next(drawn))
    assert draw_token() == "a-token"
