"""Makes an API token in a server's database: `python -m tests.support.api_seed ROLE` prints it."""

from __future__ import annotations

import sys

import django


def seed(role: str) -> str:
    """Return a new account of the first clinic a token."""
    from rehab.people.models import User
    from rehab.people.sign_in.first_start import first_clinic, prepare_database
    from tests.support.programs import bearer_token

    prepare_database()
    user = User.everywhere.create_user(f"program-{role}", role=role, clinic=first_clinic())
    return bearer_token(user, role)


if __name__ == "__main__":
    django.setup()
    print(seed(sys.argv[1]))
