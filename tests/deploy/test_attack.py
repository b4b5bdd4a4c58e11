"""Everybody sends everything to a hosted set, proxy and PostgreSQL: nothing fails or leaks."""

from __future__ import annotations

import json
import random
import ssl
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from rehab.people.roles import Role
from tests.support.api_noise import JUNK_TEXTS
from tests.support.hosted import find_missing, run_haproxy, run_postgres
from tests.support.noise import TELLTALES
from tests.support.servers import run_python, serve
from tests.support.tenancy import Route, what_leaks
from tests.support.visitors import Answer, Visitor
from tests.support.world import Actor, scoped_models

pytestmark = [
    pytest.mark.server,
    pytest.mark.long,
    pytest.mark.skipif(bool(find_missing()), reason=find_missing()),
]

REQUESTS = 7_383
METHODS = ["GET", "GET", "GET", "POST", "POST", "PUT", "PATCH", "DELETE", "HEAD", "OPTIONS"]
TYPES = ("application/x-www-form-urlencoded", "application/json", "multipart/form-data", "")
ENDS_THE_ATTACK = {"admin:logout", "sign-out", "end-sign-ins"}  # the actor's own sign-in
END_OTHERS = {"lead", "host"}  # their tablets, stations, accounts and tokens: they come last
Set = tuple[str, ssl.SSLContext, dict[str, Any]]


@dataclass(frozen=True)
class Clinic:
    """A clinic by its name, as `what_leaks` asks for it."""

    name: str


class Said:
    """An answer, as `what_leaks` reads one."""

    streaming = False

    def __init__(self, answer: Answer) -> None:
        self.status_code, self.content = answer.status, answer.body


@pytest.fixture(scope="module")
def attacked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Set]:
    """Return the address of a hosted set, what trusts it, its addresses, and who attacks it."""
    folder: Path = tmp_path_factory.mktemp("data")
    with run_postgres() as database:
        settings = {
            "GARRY_HOSTED": "1",
            "GARRY_SECRET_KEY": "0123456789" * 6,
            "GARRY_ALLOWED_HOSTS": "localhost,127.0.0.1,testserver",
            "GARRY_DATABASE_URL": database,
            "GARRY_PROXIES": "2",  # HAProxy, and each visitor tells an address of its own
        }
        for command in (["migrate", "--verbosity", "0"], ["collectstatic", "--no-input", "-v0"]):
            run_python(folder, "manage.py", *command, **settings)
        said = run_python(folder, "-m", "tests.support.attack_seed", **settings)
        (folder / "garry.sqlite3").touch()  # so that no tables are copied
        with (
            serve(folder, settings=settings) as server,
            run_haproxy(folder / "haproxy", server.port) as (_, secure, tls),
        ):
            yield secure, tls, json.loads(said.splitlines()[-1])
            log = server.read_log()
    assert "Traceback" not in log, log[-5000:]


def attack(hosted: Set, count: int) -> tuple[list[str], Counter[Any]]:
    """Send so many requests; return what failed or leaked, and how often each status came."""
    url, tls, made = hosted
    chance = random.Random(33)
    clinics: Any = (Clinic("amber"), Clinic("birch"))
    models = {model.__name__: model for model in scoped_models()}
    routes = [route for route in made["routes"] if route["name"] not in ENDS_THE_ATTACK]
    pairs = [(actor, route) for actor in made["actors"] for route in routes]
    chosen = [pair for _ in range(count // len(pairs)) for pair in pairs]
    chosen += chance.sample(pairs, count - len(chosen))
    chance.shuffle(chosen)
    chosen.sort(key=lambda pair: pair[0]["role"] in END_OTHERS)
    problems: list[str] = []
    statuses: Counter[Any] = Counter()
    for row, place in chosen:
        actor = Actor(row["label"], None, row["clinic"], row["role"])
        address = f"198.51.100.{chance.randrange(250)}"
        visitor = Visitor(url, address, dict(row["cookies"]), row["token"])
        visitor.headers, visitor.tls = {"Referer": url}, tls
        method = chance.choice(METHODS)
        body = b"" if method in ("GET", "HEAD") else make_body(chance, made)
        kind = {"Content-Type": chance.choice(TYPES)} if body else {}
        answer = visitor.request(method, place["url"], body, **kind)
        statuses[actor.label, answer.status] += 1
        what = f"{method} {place['url']} {body[:200]!r}"
        model = models.get(place["model"] or "")
        route = Route(place["name"], f"{method} {place['url']}", place["owner"], model)
        if method != "HEAD":  # a tablet shows the name of its own station
            own = actor.clinic if actor.role == "device" else ""
            others: Any = [clinic for clinic in clinics if clinic.name != own]
            problems += what_leaks(actor, route, Said(answer), others, row["hidden"])
        if any(word in answer.body for word in TELLTALES):
            problems.append(f"{actor.label}: {what} tells how it failed")
        if answer.status >= 500 and place["name"] != "readyz":
            problems.append(f"{actor.label}: {what} fails with {answer.status}")
    return problems, statuses


def make_body(chance: random.Random, made: dict[str, Any]) -> bytes:
    """Return a form or JSON of words that pages know, with keys of either clinic or nonsense."""
    words = ("patient", "session", "station", "code", "name", "action", "step", "task", "user")
    junk = [*JUNK_TEXTS, *map(str, range(1, 30)), "delete_selected", "close", "assessor", "yes"]
    fields = {word: chance.choice(junk) for word in chance.sample(words, 4)}
    match chance.randrange(4):
        case 0:
            return json.dumps(fields).encode(errors="replace")
        case 1:
            return chance.randbytes(chance.randrange(1, 200))
        case 2:
            return b"[" * chance.randrange(1, 2000)
    pairs = (f"{name}={value}" for name, value in fields.items())
    return "&".join(pairs).encode(errors="replace")


@pytest.mark.timeout(3000)
def test_nothing_fails_and_nothing_foreign_is_shown(attacked):
    roles = Counter(actor["role"] for actor in attacked[-1]["actors"])
    assert set(roles) == {*Role.values, "device", "stranger"}
    assert all(roles[role] >= 2 for role in {*roles} - {Role.HOST})  # of either clinic
    problems, statuses = attack(attacked, REQUESTS)
    assert not problems, "\n".join(problems)
    assert statuses.total() == REQUESTS
    for label in ("lead of amber", "pt of birch", "program of a pt of amber"):
        assert statuses[label, 200] > 5, (label, statuses)
    assert statuses["tablet of amber", 200] > 1, statuses  # its pages are few


def test_the_attack_finds_what_another_clinic_shows(attacked):
    """A lead of amber who is taken for one of birch sees nothing but what is foreign."""
    url, tls, made = attacked
    leads = [row | {"clinic": "birch"} for row in made["actors"] if row["label"] == "lead of amber"]
    problems, _ = attack((url, tls, made | {"actors": leads}), 200)
    assert any("of amber" in one and "shows" in one for one in problems)
