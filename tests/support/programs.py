"""A program that uses the API with a token."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from django.test import Client

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.sign_in.tokens import ApiToken
from tests.support.world import World

ROOT = "/api/v1"


def bearer_token(user: User, role: str) -> str:
    """Make an account a new API token."""
    row = ApiToken(clinic=user.clinic, user=user, name="program", role=role)
    row.may_steer = row.may_export = True
    token = row.new_token()
    row.save()
    return token


@dataclass
class Program:
    """Calls the API and gives status and JSON."""

    token: str

    def __post_init__(self) -> None:
        header = {"Authorization": f"Bearer {self.token}"}
        self.client = Client(headers=header, raise_request_exception=False)

    def get(self, path: str, **query: Any) -> tuple[int, Any]:
        """Read."""
        return self._answer(self.client.get(ROOT + path, query))

    def post(self, path: str, **body: Any) -> tuple[int, Any]:
        """Add or change."""
        return self._answer(self.client.post(ROOT + path, body, "application/json"))

    def patch(self, path: str, **body: Any) -> tuple[int, Any]:
        """Mend."""
        return self._answer(self.client.patch(ROOT + path, body, "application/json"))

    def _answer(self, response: Any) -> tuple[int, Any]:
        assert response.headers["Content-Type"].startswith("application/json"), response.content
        return response.status_code, response.json()


def program_of(world: World, role: Role) -> Program:
    """Return a program of somebody of this role."""
    return Program(bearer_token(world.people[role], role))
