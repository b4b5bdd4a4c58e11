"""Encryption of backups in the age format (age-encryption.org), which other programs open too.

Backups are encrypted to public keys, so that a machine that makes them cannot read them.
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

from rehab.people.commands import command

AGE_MAGIC = b"age-encryption.org/"


class InvalidKey(ValueError):
    """Text that is not a valid key; the message says what a key looks like."""


class CannotDecrypt(ValueError):
    """A file that cannot be decrypted; the message says why, and what to do."""


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
        raise InvalidKey(f"There is no public key. `{command('backupkey')}` makes one.")
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
    """Write chunks into an encrypted file. Errors of ``chunks`` and ``file`` are passed on."""
    buffer, remaining = bytearray(), iter(chunks)

    def read(size: int) -> bytes:
        while len(buffer) < size and (chunk := next(remaining, None)) is not None:
            buffer.extend(chunk)
        part = bytes(buffer[:size])
        del buffer[:size]
        return part

    problems: list[Exception] = []
    reader = SimpleNamespace(read=_recording_errors(problems, read))
    writer = SimpleNamespace(
        write=_recording_errors(problems, file.write), flush=_recording_errors(problems, file.flush)
    )
    try:
        pyrage.encrypt_io(reader, writer, recipients)
    except pyrage.EncryptError:
        if problems:
            raise problems[0] from None  # pyrage's own error has only its text
        raise


def _recording_errors(problems: list[Exception], call: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that also adds the exceptions of ``call`` to a list."""

    def wrapped(*args: Any) -> Any:
        try:
            return call(*args)
        except Exception as problem:
            problems.append(problem)
            raise

    return wrapped


@contextmanager
def decrypt(file: BinaryIO, identities: Sequence[Identity]) -> Iterator[BinaryIO]:
    """Provide the content of an encrypted file as a stream, in constant memory.

    Raises CannotDecrypt, at the latest at the end of the block: what was read before is genuine,
    but a file that was cut off is only recognized at its end.
    """
    magic = file.read(len(AGE_MAGIC))
    file.seek(0)
    if magic != AGE_MAGIC:
        raise CannotDecrypt("It is no backup of GARRY. Choose another file.")
    problems: list[Exception] = []
    read_end, write_end = os.pipe()

    def decrypt_into_pipe() -> None:
        try:
            with os.fdopen(write_end, "wb") as pipe:
                pyrage.decrypt_io(file, pipe, identities)
        except Exception as problem:  # raised in the reader's thread, below
            problems.append(problem)

    thread = threading.Thread(target=decrypt_into_pipe, name="decrypt")
    thread.start()
    read_error: Exception | None = None
    try:
        with os.fdopen(read_end, "rb") as pipe:
            yield pipe
    except (EOFError, OSError, zlib.error) as problem:  # compressed content that ends in the middle
        read_error = problem
    finally:
        thread.join()
    if problems or read_error:
        raise CannotDecrypt(_explain(problems[0] if problems else read_error)) from read_error


def _explain(problem: Exception | None) -> str:
    if isinstance(problem, pyrage.DecryptError) and "No matching keys" in str(problem):
        return "It was encrypted to another key. Take the secret key that belongs to it."
    return "It is damaged or was cut off. Take another copy."
