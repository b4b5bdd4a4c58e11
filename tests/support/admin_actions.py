"""Actions of the admin, as one presses them on a row's own page."""

from __future__ import annotations

from rehab.people.roles import Role
from tests.support.world import World, client_of


def act(world: World, model: str, action: str, key: int, role: Role = Role.PT):
    """Press a button on a row's own page."""
    data = {"index": 0, "action": action, "_selected_action": key, "stay": key}
    return client_of(world, role).post(f"/admin/rehab/{model}/", data)
