"""Attempts that are sent at once count one by one: none is checked that the limit forbids."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import pytest
from django.db import connection
from django.test import Client

from rehab.people.models import User
from rehab.people.sign_in import lockout
from rehab.people.sign_in.authentication_backends import PasswordBackend
from rehab.people.sign_in.factors import factors
from tests.support.accounts import add_account, add_app, enter

pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.postgres]
AT_ONCE = 30


@pytest.fixture
def pt() -> User:
    return add_account()


def count_calls(monkeypatch, owner: object, name: str) -> list[object]:
    """Return a list that grows with each call of a function."""
    calls: list[object] = []
    real = getattr(owner, name)

    def counted(*arguments, **options):
        calls.append(arguments)
        return real(*arguments, **options)

    monkeypatch.setattr(owner, name, counted)
    return calls


def at_once(attempts: list[tuple[Client, str, dict[str, str]]]) -> list[int]:
    """Send all attempts at the same moment; return their status codes."""
    together = Barrier(len(attempts))

    def send(attempt: tuple[Client, str, dict[str, str]]) -> int:
        client, url, form = attempt
        together.wait()
        try:
            return client.post(url, form).status_code
        finally:
            connection.close()

    with ThreadPoolExecutor(len(attempts)) as threads:
        return list(threads.map(send, attempts))


def test_no_more_than_five_codes_are_checked_however_many_are_sent_at_once(pt, monkeypatch):
    add_app(pt)
    enter(client := Client())
    pending = client.cookies["sessionid"].value
    attempts = []
    for number in range(AT_ONCE):
        one = Client()
        one.cookies["sessionid"] = pending
        attempts.append((one, "/sign-in/code/", {"code": f"{number:06}"}))
    checked = count_calls(monkeypatch, factors, "verify_code")
    statuses = at_once(attempts)
    assert len(checked) == 5
    assert statuses.count(429) >= AT_ONCE - 5


def test_no_more_than_five_passwords_are_checked_however_many_are_sent_at_once(pt, monkeypatch):
    checked = count_calls(monkeypatch, PasswordBackend.__base__, "authenticate")
    form = {"username": "rosa", "password": "wrong"}
    statuses = at_once([(Client(), "/sign-in/", form) for _ in range(AT_ONCE)])
    assert len(checked) == lockout.OWN_FAILURES
    assert statuses.count(429) >= AT_ONCE - 5
