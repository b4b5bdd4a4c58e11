"""The server's keys, one for each purpose, stored encrypted with the host's own key.

`GARRY_SECRET_KEY` signs cookies and encrypts these keys: it can be replaced, and what they encrypt
stays as it is. A copy of each for the backup's secret key opens them where the host's is lost.
"""

from __future__ import annotations

import hmac
import os
from base64 import b64decode, b64encode, urlsafe_b64encode
from collections.abc import Sequence
from hashlib import sha256
from typing import ClassVar

import pyrage
from cryptography.fernet import Fernet, InvalidToken, MultiFernet
from django.conf import settings
from django.db import models
from django.utils.crypto import salted_hmac
from pyrage.x25519 import Identity, Recipient


class Purpose(models.TextChoices):
    """What a key is for; a first key follows from the host's key by the text beside it."""

    STUDIES = "studies", "garry.studies allocation"
    AUTHENTICATORS = "authenticators", "garry.second_factors apps"
    DATES = "dates", "garry.exports.dates"
    TOMBSTONES = "tombstones", "garry.import_tombstones"
    RECEIVERS = "receivers", "garry.outbox secrets"


class ServerKey(models.Model):
    """A key; of a purpose the one with the highest number encrypts, and all open."""

    purpose = models.CharField(max_length=16)
    number = models.PositiveIntegerField()
    sealed = models.TextField()
    recovery = models.TextField(blank=True)  # for the backup's secret keys; empty: there were none

    class Meta:
        ordering: ClassVar = ["purpose", "-number"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["purpose", "number"], name="server_key_number")
        ]

    def __str__(self) -> str:
        return f"{self.purpose} {self.number}"

    def open(self) -> bytes | None:
        """Return the key; None where the host's key is another one now."""
        try:
            return _host_cipher().decrypt(self.sealed)
        except InvalidToken:
            return None

    def close(self, key: bytes, recipients: Sequence[Recipient]) -> None:
        """Store the key, encrypted with the host's key, and for the backup's secret keys."""
        self.sealed = _host_cipher().encrypt(key).decode()
        if recipients:
            self.recovery = b64encode(pyrage.encrypt(key, list(recipients))).decode()
        mine = ServerKey.objects.filter(purpose=self.purpose, number=self.number)
        mine.update(sealed=self.sealed, recovery=self.recovery)

    def recover(self, identities: Sequence[Identity]) -> bytes | None:
        """Return the key by a backup's secret key; None where that does not open it."""
        try:
            return bytes(pyrage.decrypt(b64decode(self.recovery), list(identities)))
        except pyrage.DecryptError:
            return None


def _host_cipher() -> MultiFernet:
    """Return a cipher with the host's keys: the present one encrypts, those from before open."""
    return MultiFernet(
        _fernet(salted_hmac("garry.server_keys", "host", secret=one, algorithm="sha256").digest())
        for one in (settings.SECRET_KEY, *settings.SECRET_KEY_FALLBACKS)
    )


def _fernet(key: bytes) -> Fernet:
    return Fernet(urlsafe_b64encode(key))


def keys_of(purpose: Purpose) -> list[bytes]:
    """Return a purpose's keys that can be opened, the newest first; none where all are lost."""
    stored = list(ServerKey.objects.filter(purpose=purpose))
    if not stored:
        return [_first_key(purpose)]
    return [key for one in stored if (key := one.open()) is not None]


def stable_key(purpose: Purpose) -> bytes:
    """Return the oldest key of a purpose: what is hashed with it can be compared for ever."""
    return (keys_of(purpose) or [_first_key(purpose)])[-1]


def _first_key(purpose: Purpose) -> bytes:
    """Return a purpose's key while none is stored: it follows from the oldest of the host's."""
    salt, _, value = str(purpose.label).partition(" ")
    host_key = (settings.SECRET_KEY, *settings.SECRET_KEY_FALLBACKS)[-1]
    key = sha256((salt + host_key).encode()).digest()
    return hmac.digest(key, value.encode(), "sha256") if value else key


def store_first(purpose: Purpose) -> None:
    """Store a purpose's first key, before something is encrypted or hashed with it."""
    if not ServerKey.objects.filter(purpose=purpose).exists():
        _add(purpose, 1, _first_key(purpose))


def add_key(purpose: Purpose, recipients: Sequence[Recipient] = ()) -> None:
    """Add a random key, with which everything is encrypted from now on."""
    newest = ServerKey.objects.filter(purpose=purpose).first()
    _add(purpose, newest.number + 1 if newest else 1, os.urandom(32), recipients)


def _add(purpose: Purpose, number: int, key: bytes, recipients: Sequence[Recipient] = ()) -> None:
    sealed = _host_cipher().encrypt(key).decode()
    one, is_new = ServerKey.objects.get_or_create(
        purpose=purpose, number=number, defaults={"sealed": sealed}
    )
    if is_new:
        one.close(key, recipients)


def close_keys_again(
    recipients: Sequence[Recipient], identities: Sequence[Identity] = ()
) -> list[ServerKey]:
    """Encrypt all keys with the host's present key and for these recipients.

    ``identities``: the backup's secret keys, for keys that the host's do not open. Return those
    that stay closed.
    """
    for purpose in Purpose:
        store_first(purpose)
    closed = []
    for one in ServerKey.objects.all():
        key = one.open() or one.recover(identities)
        if key is None:
            closed.append(one)
        else:
            one.close(key, recipients)
    return closed


def encrypt_text(purpose: Purpose, text: str) -> str:
    """Return a text, encrypted with a purpose's newest key."""
    store_first(purpose)
    if not keys_of(purpose):  # the host's key was lost
        add_key(purpose)
    return _fernet(keys_of(purpose)[0]).encrypt(text.encode()).decode()


def decrypt_text(purpose: Purpose, encrypted: str) -> str:
    """Return an encrypted text. Raises InvalidToken where the server has other keys now."""
    keys = keys_of(purpose)
    if not keys:
        raise InvalidToken
    return MultiFernet(map(_fernet, keys)).decrypt(encrypted.encode()).decode()


def encrypt_again(purpose: Purpose, encrypted: str) -> str | None:
    """Return a text encrypted with the newest key; None where it is. Raises InvalidToken."""
    ciphers = [_fernet(key) for key in keys_of(purpose)]
    try:
        ciphers[0].decrypt(encrypted.encode())
    except InvalidToken:
        return MultiFernet(ciphers).rotate(encrypted.encode()).decode()
    return None
