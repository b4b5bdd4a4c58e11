"""Backups are encrypted in the age format (age-encryption.org), which other programs open too.

They are encrypted to public keys, so that a machine that makes backups cannot read them.
"""

from __future__ import annotations

import os
import threading
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any, BinaryIO

import pyrage
from pyrage.x25519 import Identity, Recipient

AGE = b"age-encryption.org/"
OLD = b"GARRY sealed"  # of development versions before 2026-11-22


class InvalidKey(ValueError):
    """A text that holds no key; the message says what is wanted."""


class CannotDecrypt(ValueError):
    """A file that does not open; the message says what to look at."""


def generate_key() -> tuple[str, str]:
    """Return a new secret key and its public key."""
    identity = Identity.generate()
    return str(identity), str(identity.to_public())


def read_recipients(keys: Iterable[str]) -> list[Recipient]:
    """Return public keys from their texts. Raises InvalidKey."""
    try:
        recipients = [Recipient.from_str(key) for key in keys]
    except pyrage.RecipientError as problem:
        raise InvalidKey("A public key begins with age1 and has 62 characters.") from problem
    if not recipients:
        raise InvalidKey("There is no public key. `manage.py backupkey` makes one.")
    return recipients


def read_identities(text: str) -> list[Identity]:
    """Return the secret keys of a key file, one a line; # begins a comment. Raises InvalidKey."""
    lines = [line.strip() for line in text.splitlines()]
    try:
        identities = [Identity.from_str(line) for line in lines if line and line[0] != "#"]
    except pyrage.IdentityError as problem:
        raise InvalidKey(
            "A secret key begins with AGE-SECRET-KEY-1, alone on its line."
        ) from problem
    if not identities:
        raise InvalidKey("The file holds no secret key (AGE-SECRET-KEY-1…).")
    return identities


def encrypt(chunks: Iterable[bytes], file: BinaryIO, recipients: Sequence[Recipient]) -> None:
    """Write chunks into an encrypted file. What chunks or file raise is raised."""
    held, more = bytearray(), iter(chunks)

    def read(size: int) -> bytes:
        while len(held) < size and (chunk := next(more, None)) is not None:
            held.extend(chunk)
        part = bytes(held[:size])
        del held[:size]
        return part

    problems: list[Exception] = []
    reader = SimpleNamespace(read=_remembering(problems, read))
    writer = SimpleNamespace(
        write=_remembering(problems, file.write), flush=_remembering(problems, file.flush)
    )
    try:
        pyrage.encrypt_io(reader, writer, recipients)
    except pyrage.EncryptError:
        if problems:
            raise problems[0] from None  # pyrage tells it as text
        raise


def _remembering(problems: list[Exception], call: Callable[..., Any]) -> Callable[..., Any]:
    def remember(*args: Any) -> Any:
        try:
            return call(*args)
        except Exception as problem:
            problems.append(problem)
            raise

    return remember


@contextmanager
def decrypt(file: BinaryIO, identities: Sequence[Identity]) -> Iterator[BinaryIO]:
    """Offer the content of an encrypted file as a stream, in constant memory.

    Raises CannotDecrypt, at the latest when the block ends: what was read until then is genuine,
    but only the end tells that it was all.
    """
    head = file.read(len(AGE))
    file.seek(0)
    if head.startswith(OLD):
        raise CannotDecrypt(
            "It was made by a development version of GARRY from before 22 November 2026. Restore "
            "it with that version."
        )
    if head != AGE:
        raise CannotDecrypt("It is no backup of GARRY. Choose another file.")
    problems: list[Exception] = []
    read_end, write_end = os.pipe()

    def work() -> None:
        try:
            with os.fdopen(write_end, "wb") as pipe:
                pyrage.decrypt_io(file, pipe, identities)
        except Exception as problem:  # told to whoever reads
            problems.append(problem)

    thread = threading.Thread(target=work, name="decrypt")
    thread.start()
    broken: Exception | None = None
    try:
        with os.fdopen(read_end, "rb") as pipe:
            yield pipe
    except (EOFError, OSError, zlib.error) as problem:  # compressed content that ends in the middle
        broken = problem
    finally:
        thread.join()
    if problems or broken:
        raise CannotDecrypt(_explain(problems[0] if problems else broken)) from broken


def _explain(problem: Exception | None) -> str:
    if isinstance(problem, pyrage.DecryptError) and "No matching keys" in str(problem):
        return "It was encrypted to another key. Take the secret key that belongs to it."
    return "It is damaged or was cut off. Take another copy."
