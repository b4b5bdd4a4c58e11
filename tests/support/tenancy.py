"""Finds every address of the site by itself, opens it as everyone, and says what leaks."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pytest
from django.contrib import admin
from django.contrib.contenttypes.models import ContentType
from django.db.models import Model
from django.test import Client, RequestFactory
from django.urls import URLPattern, URLResolver, get_resolver, reverse

from garry_site import urls as site_urls
from rehab.boards.models import Leaderboard
from rehab.exports.fhir.api import TYPES as FHIR_TYPES
from rehab.patients.family import FamilyLink
from rehab.people.models import Clinic, Patient
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from rehab.sessions.questionnaires import QuestionnaireResponse
from rehab.sessions.robot_incidents import RobotIncident
from rehab.stations.models import Device, Station
from rehab.studies.models import Study
from rehab.studies.participants import Enrollment
from rehab.studies.power_runs import PowerRun
from tests.support.archives import words_of
from tests.support.identities import find_identities, identifying_texts
from tests.support.marks import mark
from tests.support.world import Actor, World, all_actors, scoped_models

# What a role reads in the pages of its own clinic, by the marks of tests/support/world.py.
# Researchers see no patient; a host sees clinics and accounts and nothing else.
HOST_SEES = {"Clinic", "SignOnGroup", "User"}

MARK = re.compile("zq[a-z]+?qz")  # of tests/support/world.py

# Parameters of addresses, the model that they name a row of, and by what.
KEYS: dict[str, tuple[type[Model], str]] = {
    "board_id": (Leaderboard, "pk"),
    "clinic_id": (Clinic, "pk"),
    "code": (Patient, "code"),
    "device_id": (Device, "pk"),
    "enrollment_id": (Enrollment, "pk"),
    "incident_id": (RobotIncident, "pk"),
    "link_id": (FamilyLink, "pk"),
    "patient_id": (Patient, "pk"),
    "run_id": (PowerRun, "pk"),
    "session_id": (TrainingSession, "pk"),
    "station_id": (Station, "pk"),
    "study_id": (Study, "pk"),
}


def may_read(actor: Actor, model: type[Model], clinic: str) -> bool:
    """Return, apart from the code under test, whether an actor may read a clinic's rows."""
    if actor.role == "host":
        return model.__name__ in HOST_SEES
    if actor.clinic != clinic:
        return False
    if actor.role == "sponsor":
        return model.__name__ == "Study"
    if model.__name__ in {"ApiToken", "AuditEntry"}:
        return actor.role == "lead"
    if actor.role == "researcher":  # the world's change is one of a patient
        hidden = {
            "Patient",
            "User",
            "Clinic",
            "Station",
            "Device",
            "Consent",
            "ConsentText",
            "Visit",
        }
        return model.__name__ not in {*hidden, "HistoryEntry"}
    return actor.role in {"lead", "pt"}


@dataclass(frozen=True)
class Route:
    """An address of the site with everything filled in."""

    name: str
    url: str
    owner: str | None = None  # the clinic whose row the address names
    model: type[Model] | None = None


def walk_patterns(
    resolver: URLResolver, names: tuple[str, ...] = (), route: str = ""
) -> Iterator[tuple[str, str, URLPattern]]:
    for entry in resolver.url_patterns:
        here = route + str(entry.pattern)
        if isinstance(entry, URLResolver):
            inner = (*names, entry.namespace) if entry.namespace else names
            yield from walk_patterns(entry, inner, here)
        else:
            yield ":".join((*names, entry.name or "")), here, entry


def add_routes(settings: Any, *patterns: URLPattern) -> None:
    """Add addresses to the site for one test."""
    settings.ROOT_URLCONF = (*patterns, *site_urls.urlpatterns)


def undeclared_views() -> list[str]:
    """Return the names of addresses whose view does not say who may open it."""
    return [
        name
        for name, _, pattern in walk_patterns(get_resolver())
        if not name.startswith("admin:")
        and not isinstance(getattr(pattern.callback, "access", None), frozenset)
    ]


def all_routes(worlds: tuple[World, ...]) -> Iterator[Route]:
    """Return every address that the site knows, for the rows of every clinic."""
    for name, _, pattern in walk_patterns(get_resolver()):
        wanted = set(pattern.pattern.converters) or set(
            getattr(pattern.pattern, "regex", None).groupindex
            if hasattr(pattern.pattern, "regex") and not pattern.pattern.converters
            else ()
        )
        yield from fill(name, wanted, pattern, worlds)


def fill(
    name: str, wanted: set[str], pattern: URLPattern, worlds: tuple[World, ...]
) -> Iterator[Route]:
    """Fill an address in. Fails for a parameter that it does not know: teach it the new one."""
    model = model_of_admin_route(name)
    if name == "admin:":  # Django's redirect from a bare object address to its change page
        return
    if name == "admin:autocomplete":
        for target in scoped_models():
            for related in target._meta.concrete_fields:
                if related.is_relation:
                    asked = f"app_label=rehab&model_name={target._meta.model_name}"
                    yield Route(name, f"{reverse(name)}?{asked}&field_name={related.name}&term=zq")
        return
    if not wanted and name.startswith("admin:") and name.endswith("_changelist"):
        assert model is not None
        yield Route(name, reverse(name))
        yield Route(name, f"{reverse(name)}?q=zq")
        for field in model._meta.concrete_fields:
            if field.is_relation and field.related_model in worlds[0].rows:
                for world in worlds:
                    key = world.rows[field.related_model].pk
                    yield Route(name, f"{reverse(name)}?{field.name}__id__exact={key}")
        return
    if name == "api:list_sessions":
        yield Route(name, reverse(name))
        for world in worlds:
            found_by = f"{reverse(name)}?patient={world.patient.pk}"
            yield Route(name, found_by, world.name, Patient)
        return
    if not wanted:
        assert name, f"the route {pattern} has no name, so it cannot be checked"
        yield Route(name, reverse(name))
        return
    for world in worlds:
        if wanted == {"object_id"} and model is not None:
            for row in world.rows_of(model):
                url = reverse(name, kwargs={"object_id": row.pk})
                yield Route(name, url, world.name, model)
        elif wanted == {"id"} and name == "admin:auth_user_password_change":
            user = world.people[Role.PT]
            yield Route(name, reverse(name, kwargs={"id": user.pk}), world.name, type(user))
        elif wanted == {"content_type_id", "object_id"}:
            for kind, row in world.rows.items():
                type_id = ContentType.objects.get_for_model(kind).pk
                kwargs = {"content_type_id": type_id, "object_id": row.pk}
                yield Route(name, reverse(name, kwargs=kwargs), world.name, kind)
        elif wanted == {"slug", "patient_id"}:  # of a clinical test
            for slug in ("10mwt", "fac"):
                kwargs = {"slug": slug, "patient_id": world.patient.pk}
                yield Route(name, reverse(name, kwargs=kwargs), world.name, Patient)
        elif len(wanted) == 1 and (parameter := min(wanted)) in KEYS:
            target, by = KEYS[parameter]
            for row in world.rows_of(target):
                url = reverse(name, kwargs={parameter: getattr(row, by)})
                yield Route(name, url, world.name, target)
        elif wanted == {"app_label"}:
            yield Route(name, reverse(name, kwargs={"app_label": "rehab"}))
            return
        elif wanted == {"fhir_id"}:  # of each kind the clinic's own, by its sessions
            what = name.removeprefix("api:read_")
            answered = [(one.session_id, one.pk) for one in world.rows_of(QuestionnaireResponse)]
            walked = [one.pk for one in world.rows_of(TrainingSession)]
            found = {
                "Patient": [f"patient-{one.pk}" for one in world.rows_of(Patient)],
                "Encounter": [f"session-{pk}" for pk in walked],
                "Provenance": [f"provenance-{pk}" for pk in walked],
                "QuestionnaireResponse": [f"answers-{of}-{pk}" for of, pk in answered],
                "Observation": [f"figure-{pk}-score" for pk in walked],
            }
            for one in found.get(what, ["garry"]):
                owner = (world.name, Patient) if what in found else ()
                yield Route(name, reverse(name, kwargs={"fhir_id": one}), *owner)
        elif wanted == {"fhir_type"}:
            for what in FHIR_TYPES:
                url = reverse(name, kwargs={"fhir_type": what})
                yield Route(name, f"{url}?before=2200-01-01T00:00:00Z")
        elif wanted == {"token"}:  # of a family's link; nobody knows one that is there
            yield Route(name, reverse(name, kwargs={"token": "no-such-link"}))
            return
        elif wanted == {"page"}:  # of the documentation
            yield Route(name, reverse(name, kwargs={"page": "sources"}))
            return
        elif wanted == {"language"}:
            yield Route(name, reverse(name, kwargs={"language": "es"}))
            return
        elif wanted == {"url"}:
            yield Route(name, reverse("admin:index") + "no-such-page")
            return
        else:
            pytest.fail(f"the matrix does not know how to fill {name or pattern} {wanted}")


def model_of_admin_route(name: str) -> type[Any] | None:
    for model in admin.site._registry:
        meta = model._meta
        if name.startswith(f"admin:{meta.app_label}_{meta.model_name}_"):
            return model
    return None


def enter(actor: Actor, worlds: tuple[World, ...]) -> Client:
    if actor.role == "device":
        token = next(world.token for world in worlds if world.name == actor.clinic)
        return Client(headers={"Authorization": f"Bearer {token}"}, raise_request_exception=False)
    client = Client(raise_request_exception=False)
    if actor.role != "stranger" or actor.label == "switched off":
        client.force_login(actor.subject)
    return client


def find_leaks(
    worlds: tuple[World, ...], actors: list[Actor], under: str = "/"
) -> tuple[list[str], Counter[str]]:
    """Open every address as every actor. Return what they should not have got, and counts."""
    leaks: list[str] = []
    counts: Counter[str] = Counter()
    routes = [r for r in dict.fromkeys(all_routes(worlds)) if r.url.startswith(under)]
    for actor in actors:
        client = enter(actor, worlds)
        hidden = identifying_texts(actor)
        for route in routes:
            if route.name == "admin:logout":
                continue
            response = client.get(route.url)
            counts[actor.label] += 1
            leaks += what_leaks(actor, route, response, worlds, hidden)
    return leaks, counts


def what_leaks(
    actor: Actor,
    route: Route,
    response: Any,
    worlds: tuple[World, ...],
    hidden: dict[str, str],
) -> Iterator[str]:
    """Return what is wrong with an answer: a foreign mark, a person named, a door, a failure."""
    body = words_of(response)
    for whose in find_identities(hidden, body):
        yield f"{actor.label}: {route.url} names {whose}"
    if response.status_code >= 500 and route.name != "readyz":  # no server runs here
        yield f"{actor.label}: {route.url} fails with {response.status_code}"
    marks = set(MARK.findall(body))
    for world in worlds:
        for model in scoped_models():
            if mark(world.name, model) in marks and not may_read_mark(actor, model, world):
                yield f"{actor.label}: {route.url} shows {model.__name__} of {world.name}"
    is_open = response.status_code == 200 and route.owner and route.model
    if is_open and not may_read(actor, route.model, route.owner):
        yield f"{actor.label}: {route.url} opens"


def may_read_mark(actor: Actor, model: type[Model], world: World) -> bool:
    """What may stand beside a session or a study's figures that an actor may read.

    The mark of accounts is in the reader's own name as well: `identities` tells them apart.
    """
    beside = {
        "researcher": {"User", "Station", "Clinic"},
        "sponsor": {"User", "Clinic", "Arm"},  # of a closed study
    }.get(actor.role, set())
    if actor.clinic == world.name and model.__name__ in beside:
        return True
    return may_read(actor, model, world.name)


def find_offers(worlds: tuple[World, ...], actors: list[Actor]) -> tuple[list[str], int]:
    """Look at the pickers of every admin form, in pages and inlines, for everyone who may open one.

    Return the rows of other clinics that they offer, and how many pickers there are.
    """
    leaks, checked = [], 0
    for actor in actors:
        if actor.role not in Role.values:
            continue
        request = RequestFactory().get("/")
        request.user = actor.subject
        for options in admin.site._registry.values():
            if not options.has_add_permission(request):
                continue
            forms = [options.get_form(request)]
            forms += [i.get_formset(request).form for i in options.get_inline_instances(request)]
            for name, field in [pair for form in forms for pair in form.base_fields.items()]:
                rows = getattr(field, "queryset", None)
                if rows is None:
                    continue
                checked += 1
                kind, of = rows.model, options.model.__name__
                leaks += [
                    f"{actor.label}: {of}.{name} offers {kind.__name__} of {world.name}"
                    for world in worlds
                    if world.name != actor.clinic
                    and kind.__name__ not in HOST_SEES
                    and rows.filter(pk=world.rows[kind].pk).exists()
                ]
    return leaks, checked


def some_actors(worlds: tuple[World, World], *labels: str) -> list[Actor]:
    return [actor for actor in all_actors(*worlds) if actor.label in labels]


def researchers(worlds: tuple[World, World]) -> list[Actor]:
    return [actor for actor in all_actors(*worlds) if actor.role == "researcher"]
