"""A passkey signs in its own account, here, once, for the challenge of this browser."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Callable
from typing import Any

import pytest
from django.test import Client
from django.urls import reverse

from rehab.people.audit.audit_log import AuditEntry
from rehab.people.models import User
from rehab.people.sign_in.factors.factors import Authenticator
from tests.support.accounts import add_account, add_app, enter, is_in
from tests.support.passkey import FLAG, SoftPasskey
from tests.support.world import signed_in

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]
Answer = Callable[[SoftPasskey, dict[str, Any]], str]
SECOND_FACTOR = reverse("second-factor")


@pytest.fixture(autouse=True)
def hosts(settings):
    settings.ALLOWED_HOSTS = ["localhost"]


def browser() -> Client:
    return Client(headers={"host": "localhost"})


def options_of(client: Client, url: str) -> dict[str, Any]:
    """Return what the browser is asked to do with a passkey."""
    page = client.get(url).content.decode()
    found = re.search(r'data-passkey="([^"]*)"', page)
    assert found, page
    asked: dict[str, Any] = json.loads(html.unescape(found[1]))
    return asked


def register(user: User, key: SoftPasskey, answer: Answer | None = None) -> Any:
    """Have an account store a passkey; return what the page answers."""
    client = signed_in(user)
    client.defaults["HTTP_HOST"] = "localhost"
    options = options_of(client, reverse("add-passkey"))
    made = (answer or SoftPasskey.create)(key, options)
    return client.post(reverse("add-passkey"), {"name": "Key", "passkey": made})


def pending(username: str = "rosa") -> tuple[Client, dict[str, Any]]:
    """Return a browser that has shown the password, and what its passkey is to sign."""
    client = browser()
    assert enter(client, username=username).headers["Location"] == SECOND_FACTOR
    return client, options_of(client, SECOND_FACTOR)


def prove(client: Client, answer: str) -> bool:
    """Send a signature; return whether the browser is signed in now."""
    client.post(SECOND_FACTOR, {"passkey": answer})
    return is_in(client)


@pytest.fixture
def key() -> SoftPasskey:
    """Return the passkey of rosa, which has signed seven times elsewhere."""
    key = SoftPasskey(counter=7)
    register(add_account(), key)
    assert Authenticator.everywhere.get().counter == 7
    key.counter = 8
    return key


def altered(key: SoftPasskey, options: dict[str, Any]) -> str:
    said = json.loads(key.sign(options))
    data = said["response"]["authenticatorData"]
    said["response"]["authenticatorData"] = data[:-1] + ("A" if data[-1] != "A" else "Q")
    return json.dumps(said)


def with_(**others: Any) -> Answer:
    """Return how a key signs that says something else."""

    def sign(key: SoftPasskey, options: dict[str, Any]) -> str:
        vars(key).update(others)
        return key.sign(options)

    return sign


FORGERIES: dict[str, Answer] = {
    "of another page": with_(origin="https://garry.example.evil"),
    "of another port": with_(origin="http://localhost:8001"),
    "without encryption's scheme": with_(origin="https://localhost"),
    "for another name": with_(rp_id="garry.example"),
    "of a copied key": with_(counter=7),
    "of a key that counts no more": with_(counter=0),
    "without a touch": with_(flags=FLAG(0)),
    "that creates": lambda key, options: key.sign(options, "webauthn.create"),
    "of another challenge": lambda key, options: key.sign(options | {"challenge": "A" * 43}),
    "that was altered": altered,
    "by another key of that name": lambda key, options: twin_of(key).sign(options),
    "of an unknown key": lambda key, options: SoftPasskey(counter=9).sign(options),
    "that is none": lambda key, options: "[]",
}


def twin_of(key: SoftPasskey) -> SoftPasskey:
    twin = SoftPasskey(counter=9)
    twin.id = key.id
    return twin


def test_the_accounts_own_passkey_signs_in(key):
    client, options = pending()
    assert prove(client, key.sign(options))
    assert Authenticator.everywhere.get().counter == 8


@pytest.mark.parametrize("forgery", FORGERIES)
def test_a_forged_signature_signs_nobody_in_and_is_recorded(key, forgery):
    client, options = pending()
    assert not prove(client, FORGERIES[forgery](key, options))
    assert AuditEntry.everywhere.filter(act="sign_in_failed").count() == 1
    assert Authenticator.everywhere.get().counter == 7


def test_a_signature_counts_once_and_in_its_own_browser(key):
    key.counter = 0  # as synced passkeys, so that the challenge alone decides
    Authenticator.everywhere.update(counter=0)
    client, options = pending()
    other, _ = pending()
    seen = key.sign(options)
    assert not prove(other, seen)
    assert prove(client, seen)
    client.post(reverse("sign-out"))
    for replaying in (client, browser()):
        enter(replaying)
        assert not prove(replaying, seen)  # before the page has made a challenge
        replaying.get(SECOND_FACTOR)
        assert not prove(replaying, seen)


def test_anothers_passkey_opens_no_account_and_a_challenge_is_answered_once(key):
    other = SoftPasskey()
    register(add_account("mallory"), other)
    client, options = pending()
    assert not prove(client, other.sign(options))
    assert not prove(client, key.sign(options))  # too late: that challenge is gone
    assert prove(client, key.sign(options_of(client, SECOND_FACTOR)))


def test_a_passkey_is_of_no_use_without_the_password(key):
    _, options = pending()
    assert not prove(browser(), key.sign(options))


NOT_ASKED_FOR: dict[str, Answer] = {
    "from another page": lambda key, options: SoftPasskey("https://evil.example").create(options),
    "for another challenge": lambda key, options: key.create(options | {"challenge": "A" * 43}),
    "a signature": lambda key, options: key.sign(options),
    "nothing": lambda key, options: "{}",
}


@pytest.mark.parametrize("made", NOT_ASKED_FOR)
def test_only_what_this_page_asked_for_is_stored(made):
    answer = register(add_account(), SoftPasskey(), NOT_ASKED_FOR[made])
    assert b"was not accepted" in answer.content
    assert not Authenticator.everywhere.exists()


def test_one_key_serves_one_account_once(key):
    """Stored twice, a copy would count by itself."""
    register(User.everywhere.get(username="rosa"), key)
    assert Authenticator.everywhere.count() == 1


def test_a_recovery_code_replaces_a_lost_passkey_once():
    _, codes = add_app(add_account())
    for lets_in in (True, False):
        client = browser()
        enter(client)
        client.post(SECOND_FACTOR, {"code": codes[0]})
        assert is_in(client) == lets_in
