"""Sends nonsense to every form and address of pages and admin, and looks at what comes back."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from html.parser import HTMLParser
from itertools import cycle
from typing import Any
from urllib.parse import urlencode

from django.core.files.uploadedfile import SimpleUploadedFile
from django.db import transaction
from django.test import Client
from django.test.client import BOUNDARY, MULTIPART_CONTENT
from hypothesis import strategies as st

from rehab.people.models import User
from rehab.people.roles import Role
from tests.support.api_noise import JUNK_TEXTS
from tests.support.archives import body_of
from tests.support.identities import identifying_texts
from tests.support.noise import TELLTALES, draw
from tests.support.tenancy import Route, all_routes, what_leaks
from tests.support.world import Actor, World, build_world, fill_board

SLOWEST_S = 5.0  # no answer may hold the server up
ASKED = (
    *("q", "p", "o", "e", "all", "_popup", "_to_field", "_changelist_filters", "id__in", "next"),
    *("pk__exact", "patient__id__exact", "clinic__id__exact", "after", "seen_as", "board"),
)
TYPES = (
    *(
        "text/plain",
        "application/json",
        "multipart/form-data",
        "",
        "multipart/form-data; boundary=",
    ),
    *("application/x-www-form-urlencoded", f"multipart/form-data; boundary={'x' * 300}"),
)


@dataclass(frozen=True)
class Noise:
    """A request to a page: for which row, by whom, and what is done to an honest form of it."""

    row: int
    who: int
    how: str
    changes: list[tuple[int, str]]
    left_out: list[int]
    raw: bytes
    type: str


class Form(HTMLParser):
    """Reads the fields of a page's forms as a browser would send them."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.fields: dict[str, str] = {}
        self._select: str | None = None
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note a field and its value."""
        about = {name: value or "" for name, value in attrs}
        if tag in ("input", "textarea", "button") and about.get("name"):
            self.fields.setdefault(about["name"], about.get("value", ""))
        elif tag == "select":
            self._select = about.get("name")
        elif (
            tag == "option"
            and self._select
            and ("selected" in about or self._select not in self.fields)
        ):
            self.fields[self._select] = about.get("value", "")


def make_noise() -> st.SearchStrategy[Noise]:
    """Return a strategy of requests; numbers are taken modulo what there is."""
    junk = st.sampled_from([*JUNK_TEXTS, "on", "1", "2", "[]", "{}", "x" * 70_000, "9" * 5000])
    junk |= st.text(max_size=20) | st.integers().map(str)
    numbers = st.integers(0, 10_000)
    return st.builds(
        Noise,
        row=numbers,
        who=numbers,
        how=st.sampled_from(["form", "form", "form", "parts", "file", "raw", "query"]),
        changes=st.lists(st.tuples(numbers, junk), min_size=1, max_size=4),
        left_out=st.lists(numbers, max_size=2),
        raw=st.binary(max_size=60) | st.just(b"--" + BOUNDARY.encode() + b"\r\n" * 3),
        type=st.sampled_from(TYPES),
    )


class Site:
    """All addresses of two clinics, and whoever sends noise to them."""

    def __init__(self) -> None:
        self.worlds: tuple[World, ...] = build_world("amber"), build_world("birch")
        for world in self.worlds:
            fill_board(world)
        mine = self.worlds[0]
        people = {f"{role.value} of amber": mine.people[role] for role in mine.people}
        self.actors = [
            Actor(label, user, "amber", user.role) for label, user in people.items()
        ] * 2  # whose forms have the most to them
        host = User.everywhere.create_user("host", role=Role.HOST)
        self.actors += [Actor("host", host, None, "host"), Actor("stranger", None)]
        self.routes: dict[str, list[Route]] = {}
        for route in dict.fromkeys(all_routes(self.worlds)):
            # Whether it is ready is answered with 503 here, where nothing serves sessions.
            if not route.url.startswith("/api/") and route.name != "readyz":
                self.routes.setdefault(route.name, []).append(route)
        self._cookies = {actor.label: self._sign_in(actor) for actor in self.actors}
        self._forms: dict[tuple[str, str], dict[str, str]] = {}

    @staticmethod
    def _sign_in(actor: Actor) -> Any:
        browser = Client()
        if actor.subject is not None:
            browser.force_login(actor.subject)
        return browser.cookies

    def client(self, actor: Actor) -> Client:
        """Return a browser that is signed in as somebody, whatever was done before."""
        client = Client(raise_request_exception=False)
        for name, morsel in self._cookies[actor.label].items():
            client.cookies[name] = morsel.value
        return client

    def form(self, actor: Actor, route: Route) -> dict[str, str]:
        """Return what an honest form of a page would send."""
        key = actor.label, route.url
        if key not in self._forms:
            page = self.client(actor).get(route.url)
            self._forms[key] = dict(Form(body_of(page).decode(errors="replace")).fields)
        return self._forms[key]

    def send(self, name: str, noise: Noise) -> tuple[Actor, Route, Any]:
        """Make a request to one of a page's addresses; nothing of what it does stays."""
        actor = self.actors[noise.who % len(self.actors)]
        route = self.routes[name][noise.row % len(self.routes[name])]
        with transaction.atomic():
            fields: dict[str, Any] = dict(self.form(actor, route))
            names = [*fields, *ASKED, "action", "_selected_action", "unknown"]
            for index in noise.left_out:
                fields.pop(names[index % len(names)], None)
            changed = {names[index % len(names)]: text for index, text in noise.changes}
            response = self._request(self.client(actor), route.url, noise, fields, changed)
            transaction.set_rollback(True)
        return actor, route, response

    def _request(
        self, client: Client, url: str, noise: Noise, fields: dict[str, Any], changed: Any
    ) -> Any:
        plain = "application/x-www-form-urlencoded"
        match noise.how:
            case "query":
                between = "&" if "?" in url else "?"
                return client.get(url + between + encode(changed.items()))
            case "raw":
                return client.generic("POST", url, noise.raw, noise.type)
            case "parts":
                data = {
                    name: text.encode(errors="replace").decode()
                    for name, text in (fields | changed).items()
                }
                return client.post(url, data, content_type=MULTIPART_CONTENT)
            case "file":
                name = next(iter(changed))
                there = SimpleUploadedFile("../x\x00.csv", noise.raw, "text/html")
                return client.post(url, {**fields, name: there})
        body = encode([*fields.items(), *changed.items()] if noise.raw else changed.items())
        return client.generic("POST", url, body, plain)


def encode(pairs: Iterable[tuple[str, str]]) -> str:
    """Write names and texts as browsers do; what is no Unicode goes as bytes."""
    return urlencode([(name, text.encode("utf-8", "surrogatepass")) for name, text in pairs])


class Inspector:
    """Sends noise to a site and fails at the first request that is not answered as it should be."""

    def __init__(self) -> None:
        self.site = Site()
        self.hidden = {actor.label: identifying_texts(actor) for actor in self.site.actors}
        self.answers: Counter[int] = Counter()
        self.reached: Counter[str] = Counter()  # with a page
        self.slowest_s = 0.0

    def look(self, noises: list[Noise]) -> None:
        """Send noise to all pages in turn."""
        for noise, name in zip(noises, cycle(sorted(self.site.routes)), strict=False):
            began = time.perf_counter()
            actor, route, response = self.site.send(name, noise)
            self.slowest_s = max(self.slowest_s, time.perf_counter() - began)
            self.answers[response.status_code] += 1
            self.reached[name] += response.status_code == 200
            self._check(actor, route, response, noise)
        assert self.slowest_s < SLOWEST_S

    def _check(self, actor: Actor, route: Route, response: Any, noise: Noise) -> None:
        asked = (actor.label, route.url, noise)
        assert response.status_code < 500, asked
        if not response.streaming:
            assert not any(word in response.content for word in TELLTALES), asked
            leaks = what_leaks(actor, route, response, self.site.worlds, self.hidden[actor.label])
            assert list(leaks) == [], asked

    def tell(self) -> str:
        """Return what came of it."""
        opened = sum(map(bool, self.reached.values()))
        counts = ", ".join(f"{code}: {number}" for code, number in sorted(self.answers.items()))
        return (
            f"{self.answers.total()} requests to {len(self.reached)} routes ({opened} gave a page; "
            f"{counts}), slowest {1000 * self.slowest_s:.0f} ms"
        )


def run_noise(count: int) -> str:
    """Send so many requests; fail at the first that is not answered as it should be."""
    inspector = Inspector()
    inspector.look(draw(make_noise(), count))
    return inspector.tell()
