"""Accounts that sign in by the pages: with a password, an app, and a browser."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

from django.test import Client
from django.utils import timezone

from rehab.people.models import Clinic, User
from rehab.people.roles import Role
from rehab.people.sign_in.factors import factors
from rehab.people.sign_in.factors.totp import TIME_STEP_S, generate_code, generate_secret

PASSWORD = "walk well 2026"


def add_account(username: str = "rosa", role: Role = Role.PT, clinic: Clinic | None = None) -> User:
    """Return a new account with the password; at the clinic Elm unless it is a host."""
    if clinic is None and role != Role.HOST:
        clinic, _ = Clinic.everywhere.get_or_create(name="Elm")
    return User.everywhere.create_user(username, password=PASSWORD, role=role, clinic=clinic)


def enter(
    client: Client,
    password: str = PASSWORD,
    username: str = "rosa",
    next_url: str = "",
    **options: Any,
) -> Any:
    """Fill in the sign-in page; return the answer."""
    form = {"username": username, "password": password, "next": next_url}
    return client.post("/sign-in/", form, **options)


def is_in(client: Client) -> bool:
    """Return whether a page for therapists opens."""
    return client.get("/start/").status_code == 200


def code_of(secret: str, steps_ago: int = 0) -> str:
    """Return the code that an app with this secret shows, or showed so many half-minutes ago."""
    return generate_code(secret, int(timezone.now().timestamp()) // TIME_STEP_S - steps_ago)


def add_app(user: User) -> tuple[str, list[str]]:
    """Enroll an app an hour ago; return its secret and the recovery codes."""
    secret, then = generate_secret(), timezone.now() - timedelta(hours=1)
    return secret, factors.add_app(user, secret, code_of(secret, 3600 // TIME_STEP_S), then)
