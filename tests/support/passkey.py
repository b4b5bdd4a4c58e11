"""A passkey in software, which also signs what an honest one would not."""

from __future__ import annotations

import json
import secrets
from typing import Any

from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from fido2.cose import ES256
from fido2.utils import sha256, websafe_encode
from fido2.webauthn import (
    Aaguid,
    AttestationObject,
    AttestedCredentialData,
    AuthenticatorData,
    CollectedClientData,
)

FLAG = AuthenticatorData.FLAG
NONE = FLAG(0)
PRESENT = FLAG.UP | FLAG.UV


class SoftPasskey:
    """A device that has one key for the server at `origin`."""

    def __init__(self, origin: str = "http://localhost", counter: int = 0) -> None:
        self.origin, self.rp_id, self.counter = origin, "localhost", counter
        self.flags = PRESENT
        self.id = secrets.token_bytes(16)
        self._key = ec.generate_private_key(ec.SECP256R1())

    def create(self, options: dict[str, Any]) -> str:
        """Return the answer of a browser that was asked to create a passkey."""
        public = ES256.from_cryptography_key(self._key.public_key())
        credential = AttestedCredentialData.create(Aaguid.NONE, self.id, public)
        data = self._data(FLAG.AT, bytes(credential))
        attestation = AttestationObject.create("none", data, {})
        client_data = self._client_data("webauthn.create", options)
        return self._answer({"attestationObject": attestation, "clientDataJSON": client_data})

    def sign(self, options: dict[str, Any], kind: str = "webauthn.get") -> str:
        """Return the answer of a browser that was asked to sign in."""
        data, client_data = self._data(), self._client_data(kind, options)
        signature = self._key.sign(bytes(data) + client_data.hash, ec.ECDSA(hashes.SHA256()))
        return self._answer(
            {"authenticatorData": data, "clientDataJSON": client_data, "signature": signature}
        )

    def _data(self, more: FLAG = NONE, credential: bytes = b"") -> AuthenticatorData:
        hashed = sha256(self.rp_id.encode())
        made: AuthenticatorData = AuthenticatorData.create(
            hashed, self.flags | more, self.counter, credential
        )
        return made

    def _client_data(self, kind: str, options: dict[str, Any]) -> CollectedClientData:
        challenge = options["challenge"]
        return CollectedClientData.create(type=kind, challenge=challenge, origin=self.origin)

    def _answer(self, response: dict[str, bytes]) -> str:
        encoded = {name: websafe_encode(bytes(value)) for name, value in response.items()}
        own = websafe_encode(self.id)
        return json.dumps({"id": own, "rawId": own, "type": "public-key", "response": encoded})
