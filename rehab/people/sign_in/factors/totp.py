"""Time-based one-time passwords: the six digits of an authenticator app (RFC 6238)."""

from __future__ import annotations

import base64
import hashlib
import hmac
import secrets
import struct
from urllib.parse import quote, urlencode

TIME_STEP_S = 30
DIGITS = 6
DRIFT_STEPS = 1  # time steps that a phone's clock may be off, each way
ISSUER = "GARRY"


def generate_secret() -> str:
    """Return a new secret to share with an app, in base 32."""
    return base64.b32encode(secrets.token_bytes(20)).decode()


def provisioning_uri(secret: str, account: str) -> str:
    """Return the ``otpauth`` address that the QR code hands to an app."""
    query = urlencode({"secret": secret, "issuer": ISSUER}, quote_via=quote)
    return f"otpauth://totp/{quote(f'{ISSUER}:{account}')}?{query}"


def generate_code(secret: str, time_step: int) -> str:
    """Return the code of a time step (RFC 4226, section 5.3)."""
    digest = hmac.digest(base64.b32decode(secret), struct.pack(">Q", time_step), hashlib.sha1)
    start = digest[-1] & 15
    (value,) = struct.unpack(">I", digest[start : start + 4])
    return f"{(value & 0x7FFFFFFF) % 10**DIGITS:0{DIGITS}}"


def matching_time_step(secret: str, code: str, now_s: float) -> int | None:
    """Return the time step around ``now_s`` whose code this is; None for a wrong code."""
    typed = "".join(code.split())
    if not (typed.isascii() and typed.isdecimal()):
        return None
    now = int(now_s // TIME_STEP_S)
    matching = [
        time_step
        for time_step in range(now - DRIFT_STEPS, now + DRIFT_STEPS + 1)
        if hmac.compare_digest(generate_code(secret, time_step), typed)
    ]
    return max(matching, default=None)
