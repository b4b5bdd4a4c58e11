"""Sealing of a study's secret: the database alone does not reveal the next allocation."""

from __future__ import annotations

from base64 import urlsafe_b64encode

from cryptography.fernet import Fernet, InvalidToken
from django.utils.crypto import salted_hmac
from django.utils.translation import gettext

from rehab.studies.allocation.scheme import Secret
from rehab.training.measures import InvalidSetting


def _cipher() -> Fernet:
    key = salted_hmac("garry.studies", "allocation", algorithm="sha256").digest()
    return Fernet(urlsafe_b64encode(key))


def seal(secret: Secret) -> str:
    """Return a secret, encrypted with a key of the server's own."""
    return _cipher().encrypt(secret.to_text().encode()).decode()


def unseal(sealed: str) -> Secret:
    """Return a sealed secret. Raises InvalidSetting where the server has another key now."""
    try:
        return Secret.from_text(_cipher().decrypt(sealed.encode()).decode())
    except InvalidToken:
        raise InvalidSetting(
            gettext(
                "The allocation was sealed with another key of the server. Start GARRY with the "
                "GARRY_SECRET_KEY with which the study was planned."
            )
        ) from None
