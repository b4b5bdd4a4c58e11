"""Sealing of a study's secret: the database alone does not reveal the next allocation."""

from __future__ import annotations

from cryptography.fernet import InvalidToken
from django.utils.translation import gettext

from rehab.people.server_keys import Purpose, decrypt_text, encrypt_text
from rehab.studies.allocation.scheme import Secret
from rehab.training.measures import InvalidSetting


def seal(secret: Secret) -> str:
    """Return a secret, encrypted with a key of the server's own."""
    return encrypt_text(Purpose.STUDIES, secret.to_text())


def unseal(sealed: str) -> Secret:
    """Return a sealed secret. Raises InvalidSetting where the server has another key now."""
    try:
        return Secret.from_text(decrypt_text(Purpose.STUDIES, sealed))
    except InvalidToken:
        raise InvalidSetting(
            gettext(
                "The allocation was sealed with another key of the server. Start GARRY with the "
                "GARRY_SECRET_KEY with which the study was planned."
            )
        ) from None
