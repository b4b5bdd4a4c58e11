"""A sealed file opens with its passphrase, whole, or says why not."""

import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rehab.exports import sealed
from rehab.exports.sealed import CHUNK, MAGIC, PREFIX, SALT, TAG, CannotUnseal, Sealer, unseal

PASSPHRASE = "correct horse battery staple"
HEAD = len(MAGIC) + SALT + PREFIX


@pytest.fixture(autouse=True, scope="module")
def cheap_guesses():
    """Make keys quickly: what a guess costs is not what is tried here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sealed, "SCRYPT_N", 2)
        yield


def seal(content, passphrase=PASSPHRASE):
    file = io.BytesIO()
    sealer = Sealer(file, passphrase)
    for start in range(0, len(content), 100_000):
        sealer.write(content[start : start + 100_000])
    sealer.close()
    return file.getvalue()


def open_up(data, passphrase=PASSPHRASE):
    return b"".join(unseal(io.BytesIO(data), passphrase))


@pytest.mark.parametrize("size", [0, 1, CHUNK - 1, CHUNK, CHUNK + 1, 2 * CHUNK, 3 * CHUNK + 7])
def test_what_was_sealed_comes_out(size):
    content = bytes(n % 251 for n in range(size))
    data = seal(content)
    assert open_up(data) == content
    assert len(data) == HEAD + size + TAG * max(1, -(-size // CHUNK))


def test_nothing_of_it_can_be_read_and_no_two_files_are_alike():
    content = b"Rosa walked" * 100
    first, second = seal(content), seal(content)
    assert b"Rosa" not in first
    assert first[HEAD:] != second[HEAD:]


def test_another_passphrase_opens_nothing():
    with pytest.raises(CannotUnseal, match="passphrase is another one"):
        open_up(seal(b"secret"), PASSPHRASE + ".")


@settings(max_examples=60)
@given(st.integers(0, HEAD + 2 * CHUNK + 2 * TAG - 1), st.integers(1, 255))
def test_no_byte_can_be_changed(place, change):
    data = bytearray(seal(b"x" * 2 * CHUNK))
    data[place] ^= change
    with pytest.raises(CannotUnseal):
        open_up(bytes(data))


@pytest.mark.parametrize("length", [0, 10, HEAD, HEAD + 5, HEAD + CHUNK + TAG, -1, -TAG])
def test_it_cannot_be_cut_off(length):
    with pytest.raises(CannotUnseal):
        open_up(seal(b"x" * (2 * CHUNK + 50))[:length])


def test_chunks_cannot_be_swapped_left_out_or_repeated():
    data = seal(b"a" * CHUNK + b"b" * CHUNK + b"c")
    size = CHUNK + TAG
    head, first, second, last = (
        data[:HEAD],
        data[HEAD : HEAD + size],
        data[HEAD + size : HEAD + 2 * size],
        data[HEAD + 2 * size :],
    )
    for wrong in (
        head + second + first + last,
        head + second + last,
        head + first + last,
        head + first + first + second + last,
        head + first + second + last + last,
    ):
        with pytest.raises(CannotUnseal):
            open_up(wrong)


def test_another_file_is_none():
    with pytest.raises(CannotUnseal, match="no backup of GARRY"):
        open_up(b"PK\x03\x04 something else entirely, and long enough")
