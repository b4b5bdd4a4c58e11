"""Admin of clinics, accounts, patients and API tokens, and of what is logged of them."""

from rehab.people.admin import accounts, audit, clinics, entry, patients, tokens

__all__ = ["accounts", "audit", "clinics", "entry", "patients", "tokens"]
