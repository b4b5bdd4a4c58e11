"""Codes of authenticator apps and for recovery: which count, and what they cost to try."""

from __future__ import annotations

import re
import runpy

import pytest

from rehab.people.random_codes import ALPHABET
from rehab.people.sign_in.factors import recovery_codes, totp
from rehab.people.sign_in.factors.totp import TIME_STEP_S, generate_code, matching_time_step
from tests.support.world import NOW

RFC_SECRET = "GEZDGNBVGY3TQOJQGEZDGNBVGY3TQOJQ"  # "12345678901234567890"


@pytest.mark.parametrize(
    ("now_s", "code"),  # RFC 6238, appendix B, SHA1, the last six digits
    [
        (59, "287082"),
        (1111111109, "081804"),
        (1111111111, "050471"),
        (1234567890, "005924"),
        (2000000000, "279037"),
        (20000000000, "353130"),
    ],
)
def test_codes_are_those_of_the_standard(now_s, code):
    assert generate_code(RFC_SECRET, now_s // TIME_STEP_S) == code
    assert matching_time_step(RFC_SECRET, f"{code[:3]} {code[3:]}", now_s) == now_s // TIME_STEP_S


@pytest.mark.parametrize("drift", [-2, -1, 0, 1, 2])
def test_a_phone_may_be_half_a_minute_off(drift):
    now = 1234567890
    code = generate_code(RFC_SECRET, now // TIME_STEP_S + drift)
    assert (matching_time_step(RFC_SECRET, code, now) is not None) == (abs(drift) <= 1)


@pytest.mark.parametrize("code", ["", " ", "28708", "2870820", "٢٨٧٠٨٢", "28708x", "-287082"])
def test_what_is_no_code_is_refused(code):
    assert matching_time_step(RFC_SECRET, code, 59) is None


def test_recovery_codes_are_read_as_people_type_them():
    code = recovery_codes.generate_code()
    assert re.fullmatch("([2-9A-Z]{4}-){4}[2-9A-Z]{4}", code)
    assert len(ALPHABET) ** recovery_codes.CODE_LENGTH > 2**80
    stored = recovery_codes.hash_code(code, 1, NOW)
    typed = f" {code.lower().replace('-', ' ')} "
    assert recovery_codes.hash_code(typed, 1, NOW) == stored
    other = recovery_codes.generate_code()
    assert recovery_codes.hash_code(other, 1, NOW) != stored
    assert recovery_codes.hash_code(code, 2, NOW) != stored  # of another account


def test_a_stored_recovery_code_costs_time_and_memory_to_try():
    product = runpy.run_path(recovery_codes.__file__)  # the tests' own is quick
    assert product["SCRYPT_N"] * product["SCRYPT_R"] * 128 >= 16 * 2**20


def test_an_app_reads_who_and_where_from_the_square():
    address = totp.provisioning_uri(RFC_SECRET, "rosa@elm")
    assert address == f"otpauth://totp/GARRY%3Arosa%40elm?secret={RFC_SECRET}&issuer=GARRY"
