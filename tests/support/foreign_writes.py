"""Sends every page forms that name another clinic's rows, and says what got through."""

from __future__ import annotations

from typing import Any

from django.db import connection, transaction
from django.test import Client
from django.urls import reverse

from rehab.people.roles import Role
from tests.support.archives import words_of
from tests.support.marks import mark
from tests.support.tenancy import MARK, all_routes, enter
from tests.support.world import Actor, World, scoped_models

# What lets a page act, beside the keys: the words of its buttons and fields.
WORDS = {
    "step": "close",
    "task": "assessor",
    "action": "delete_selected",
    "kind": "tablet",
    **dict.fromkeys(("reason", "note", "nickname", "name", "new"), "by a stranger"),
    **dict.fromkeys(("emergency", "keep_data", "answer", "post", "delete", "confirm"), "yes"),
    "purpose": "research",
    "consent_version": "1",
    "consented_on": "2026-11-01",
    "field": "note",
    "day": "2026-12-01",
    "questionnaire": "tlx",
    "words_0": "by a stranger",
    "then": "walk",
    "value": 3,
    "number": 1,
}
Stored = dict[str, list[Any]]


class Undo(Exception):
    """Takes back what a form has changed."""


def form_of(world: World) -> dict[str, Any]:
    """Return a form in which whatever a page may take for a key names a row of this clinic."""
    person, patient = world.people[Role.PT].pk, world.patient
    rows = {model._meta.model_name: row.pk for model, row in world.rows.items()}
    named = {"session": world.session.pk, "which": person, "user": person, "run": rows["powerrun"]}
    named |= {"remove": rows["visit"], "take": rows["studymark"], "_selected_action": patient.pk}
    named |= {"response": rows["questionnaireresponse"], "code": patient.code}
    return WORDS | rows | named


def read_stored(world: World) -> Stored:
    """Return all that is stored of a clinic, by model."""
    return {
        model.__name__: list(
            model.everywhere.filter(**{model.scope.clinic: world.clinic.pk})
            .order_by("pk")
            .values_list()
        )
        for model in scoped_models()
    }


def send(
    client: Client, url: str, form: dict[str, Any], watched: World, before: Stored
) -> tuple[int, str, list[str]]:
    """Send a form; return status and words of the answer, and the models that it changed.

    What it changed is taken back.
    """
    writes: list[str] = []

    def note(execute: Any, sql: str, params: Any, many: bool, context: Any) -> Any:
        if not sql.startswith(("SELECT", "SAVEPOINT", "RELEASE", "ROLLBACK")):
            writes.append(sql)
        return execute(sql, params, many, context)

    changed: list[str] = []
    try:
        with transaction.atomic():
            with connection.execute_wrapper(note):
                answer = client.post(url, form)
                words = words_of(answer)
            if writes:
                after = read_stored(watched)
                changed = [name for name in after if after[name] != before[name]]
            raise Undo
    except Undo:
        return answer.status_code, words, changed


def find_foreign_writes(
    worlds: tuple[World, World], actor: Actor, under: str = "/"
) -> tuple[list[str], int]:
    """Return what somebody's forms did to the other clinic or were shown of it, and their count.

    Calls of the API, whose bodies are known, are tried in tests/api/test_tenancy.py.
    """
    other = next(world for world in worlds if world.name != actor.clinic)
    client, form, before = enter(actor, worlds), form_of(other), read_stored(other)
    sent = {str(value) for value in form.values()}
    foreign = {mark(other.name, model) for model in scoped_models()} - sent
    left_out = {reverse(name) for name in ("sign-out", "admin:logout", "end-sign-ins")}
    leaks, count = [], 0
    for route in dict.fromkeys(all_routes(worlds)):
        if route.name.startswith("api:") or "?" in route.url or route.url in left_out:
            continue
        if not route.url.startswith(under):
            continue
        status, words, changed = send(client, route.url, form, other, before)
        count += 1
        told = f"{actor.label}: {route.url}"
        leaks += [f"{told} changes {name} of {other.name}" for name in changed]
        leaks += [f"{told} shows {found}" for found in set(MARK.findall(words)) & foreign]
        if status >= 500 and route.name != "readyz":
            leaks.append(f"{told} fails with {status}")
        if route.owner == other.name and 200 <= status < 300:
            leaks.append(f"{told} answers {status}")
    return leaks, count
