"""Fill a server's database with sessions: `python -m tests.support.live_seed COUNT`.

They run, in one clinic; with `apart` each in a clinic of its own, with `ready` none has begun.
"""

from __future__ import annotations

import json
import os
import sys
from typing import Any

import django


def seed(count: int, *, apart: bool = False, ready: bool = False) -> list[dict[str, Any]]:
    """Make so many sessions, each with its station and devices; give ids and tokens."""
    from importlib import import_module

    from django.conf import settings
    from django.contrib.auth import BACKEND_SESSION_KEY, HASH_SESSION_KEY, SESSION_KEY
    from django.db import transaction
    from django.utils import timezone

    from rehab.people.models import Clinic, Patient, User
    from rehab.people.roles import Role
    from rehab.people.sign_in.first_start import first_clinic, prepare_database
    from rehab.people.sign_in.two_stage_sign_in import BACKEND
    from rehab.sessions.live.session.aggregate import SessionAggregate
    from rehab.sessions.services import SessionRequest, create_session
    from rehab.stations.models import Device, Station
    from rehab.training.changes import Change, ChangeKind
    from rehab.training.goals import GoalRule
    from rehab.training.phases import make_phase
    from tests.support.programs import bearer_token
    from tests.support.tablets import approved
    from tests.support.world import store

    def add_people(clinic: Clinic, name: str) -> dict[str, Any]:
        person = User.everywhere.create_user(f"pt{name}", role=Role.PT, clinic=clinic)
        cookies = import_module(settings.SESSION_ENGINE).SessionStore()
        cookies[SESSION_KEY] = str(person.pk)
        cookies[BACKEND_SESSION_KEY] = BACKEND
        cookies[HASH_SESSION_KEY] = person.get_session_auth_hash()
        cookies.save()
        return {"clinic": clinic.pk, "cookie": cookies.session_key}

    prepare_database()
    made = []
    with transaction.atomic():
        clinic, people = first_clinic(), None
        for index in range(count):
            name = f"{os.getpid()}-{index}"
            if apart:
                clinic = Clinic.everywhere.create(name=name)
            if people is None or apart:
                people = add_people(clinic, name)
            if apart:
                program = User.everywhere.create_user(f"api{name}", role="pt", clinic=clinic)
                people["token"] = bearer_token(program, "pt")
            station = Station.everywhere.create(clinic=clinic, name=name)
            patient = Patient.everywhere.create(
                clinic=clinic, code=name, nickname=name[:32], paretic_side="left"
            )
            tokens = {}
            for kind in Device.Kind.values:
                _, tokens[kind] = approved(station, kind, kind=kind)
            session = create_session(
                SessionRequest(
                    patient=patient,
                    valence="binary",
                    goal=GoalRule(value=3.0),
                    phases=(make_phase("training"),),
                    station=station,
                )
            )
            aggregate = SessionAggregate(session)
            if not ready:
                store(aggregate, aggregate.change(Change(ChangeKind.START), None, timezone.now()))
            keys = {"session": session.pk, "place": {"patient": patient.pk, "station": station.pk}}
            made.append({**keys, **people, **tokens})
    return made


if __name__ == "__main__":
    django.setup()
    print(json.dumps(seed(int(sys.argv[1]), apart="apart" in sys.argv, ready="ready" in sys.argv)))
