"""Files that only a passphrase opens.

scrypt makes the key of the passphrase; AES-256-GCM seals chunks one after the other (the STREAM
construction of Hoang, Reyhanitabar, Rogaway and Vizár, CRYPTO 2015): a chunk's nonce holds its
number and whether it is the last, so that none can be changed, swapped, left out or cut off
unnoticed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import BinaryIO

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESGCM
from cryptography.hazmat.primitives.kdf.scrypt import Scrypt

MAGIC = b"GARRY sealed 1\n"
CHUNK = 256 * 1024
TAG = 16
SALT, PREFIX = 16, 7
# 128 MiB and a good half second on a core of 2026: what a guess costs.
SCRYPT_N, SCRYPT_R, SCRYPT_P = 2**17, 8, 1


class CannotUnseal(ValueError):
    """A file that does not open; the message says what to look at."""


def _cipher(passphrase: str, salt: bytes) -> AESGCM:
    key = Scrypt(salt=salt, length=32, n=SCRYPT_N, r=SCRYPT_R, p=SCRYPT_P)
    return AESGCM(key.derive(passphrase.encode()))


def _nonce(prefix: bytes, number: int, *, last: bool) -> bytes:
    return prefix + number.to_bytes(4, "big") + bytes([last])


class Sealer:
    """Writes a sealed file. It is whole only once ``close`` has been called."""

    def __init__(self, file: BinaryIO, passphrase: str) -> None:
        salt, self._prefix = os.urandom(SALT), os.urandom(PREFIX)
        self._file, self._cipher = file, _cipher(passphrase, salt)
        self._held, self._number = bytearray(), 0
        file.write(MAGIC + salt + self._prefix)

    def write(self, data: bytes) -> int:
        """Take more of the content."""
        self._held += data
        while len(self._held) > CHUNK:
            self._seal(bytes(self._held[:CHUNK]), last=False)
            del self._held[:CHUNK]
        return len(data)

    def close(self) -> None:
        """Seal the rest."""
        self._seal(bytes(self._held), last=True)

    def _seal(self, chunk: bytes, *, last: bool) -> None:
        nonce = _nonce(self._prefix, self._number, last=last)
        self._file.write(self._cipher.encrypt(nonce, chunk, MAGIC))
        self._number += 1


def unseal(file: BinaryIO, passphrase: str) -> Iterator[bytes]:
    """Give a sealed file's content, chunk by chunk. Raises CannotUnseal.

    What has been given is genuine, but only the end says that it was all.
    """
    head = file.read(len(MAGIC) + SALT + PREFIX)
    if not head.startswith(MAGIC) or len(head) < len(MAGIC) + SALT + PREFIX:
        raise CannotUnseal("This is no backup of GARRY. Choose another file.")
    salt, prefix = head[len(MAGIC) : -PREFIX], head[-PREFIX:]
    cipher, number = _cipher(passphrase, salt), 0
    chunk = file.read(CHUNK + TAG)
    while True:
        following = file.read(CHUNK + TAG)
        try:
            yield cipher.decrypt(_nonce(prefix, number, last=not following), chunk, MAGIC)
        except InvalidTag:
            raise CannotUnseal(
                "The passphrase is another one, or the file is damaged."
                if number == 0
                else "The file is damaged or was cut off. Take another copy."
            ) from None
        if not following:
            return
        chunk, number = following, number + 1
