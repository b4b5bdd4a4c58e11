"""Two clinics and all who attack them: `python -m tests.support.attack_seed` prints them."""

from __future__ import annotations

import json
import os
from datetime import UTC, datetime
from typing import Any

import django


def seed() -> dict[str, Any]:
    """Build both clinics; return the actors with what lets them in, and every address."""
    from django.test.utils import setup_test_environment

    from rehab.people.roles import Role
    from rehab.people.sign_in.first_start import prepare_database
    from rehab.people.sign_in.two_stage_sign_in import SECOND_FACTOR_VERIFIED
    from tests.support.identities import identifying_texts
    from tests.support.programs import bearer_token
    from tests.support.tenancy import all_routes, enter
    from tests.support.world import Actor, all_actors, build_world, fill_board

    prepare_database()
    setup_test_environment()
    worlds = build_world("amber"), build_world("birch")
    for world in worlds:
        fill_board(world)
    made = []

    def add(actor: Actor, client: Any, token: str = "", **cookies: str) -> None:
        kept = {name: morsel.value for name, morsel in client.cookies.items()} | cookies
        hidden = identifying_texts(actor)
        about = {"label": actor.label, "clinic": actor.clinic, "role": actor.role}
        made.append(about | {"cookies": kept, "token": token, "hidden": hidden})

    for actor in all_actors(*worlds):
        client = enter(actor, worlds)
        if actor.role == Role.HOST:  # who comes in by a second factor alone
            session = client.session
            session[SECOND_FACTOR_VERIFIED] = True
            session.save()
        world = next((one for one in worlds if one.name == actor.clinic), None)
        add(actor, client, world.token if world and actor.role == "device" else "")
    for world in worlds:
        tablet, device = world.add_tablet()
        add(Actor(f"tablet of {world.name}", device, world.name, "device"), tablet)
    for role in (Role.PT, Role.RESEARCHER, Role.LEAD):
        user = worlds[0].people[role]
        program = Actor(f"program of a {role} of amber", user, "amber", role.value)
        add(program, enter(Actor("", None), worlds), bearer_token(user, role))
    routes = [
        {"name": route.name, "url": route.url, "owner": route.owner, "model": model}
        for route in dict.fromkeys(all_routes(worlds))
        for model in [route.model.__name__ if route.model else None]
    ]
    return {"actors": made, "routes": routes}


if __name__ == "__main__":
    os.environ["GARRY_TEST_CLOCK"] = datetime.now(UTC).isoformat()
    django.setup()
    print(json.dumps(seed()))
