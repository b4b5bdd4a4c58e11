"""A flood of sign-ins costs the server next to nothing."""

from __future__ import annotations

import asyncio
import threading
from datetime import timedelta
from typing import Any

import pytest
import time_machine
from asgiref.sync import sync_to_async
from django.test import RequestFactory
from django.utils import timezone

from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.sign_in import hashing, known_browsers, lockout
from rehab.people.sign_in.flood_gate import (
    ALL_BURST,
    ALL_INTERVAL_S,
    AT_ONCE,
    BURST,
    INTERVAL_S,
    LANE_BURST,
    LANE_INTERVAL_S,
    MAX_WAITING,
    SignInGate,
)
from rehab.people.sign_in.hashing import HashingBusy, HashingPool
from rehab.people.sign_in.known_browsers import Lanes, lane_of_browser


class Site:
    """What is behind the gate: it notes who came through, and waits until told to answer."""

    def __init__(self, *, answers: bool = True) -> None:
        self.entered = 0
        self.at_once = self.most_at_once = 0
        self.may_answer = asyncio.Event()
        if answers:
            self.may_answer.set()

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        self.entered += 1
        self.at_once += 1
        self.most_at_once = max(self.most_at_once, self.at_once)
        await self.may_answer.wait()
        self.at_once -= 1
        await send({"type": "http.response.start", "status": 200, "headers": []})


class Caller:
    """Sends requests through a gate, by a clock of its own."""

    def __init__(self, site: Site) -> None:
        self.now_s = 0.0
        self.lanes: dict[str, int] = {}  # of addresses
        self.gate = SignInGate(site, lambda: self.now_s, self.find_lane)

    async def find_lane(self, cookies: Any, address: str) -> int | None:
        """Return the lane that an address keeps."""
        return self.lanes.get(address)

    async def call(
        self, address: str = "192.0.2.1", method: str = "POST", path: str = "/sign-in/", **headers
    ) -> tuple[int, dict[bytes, bytes], str]:
        """Send one request; return its status, headers and text."""
        sent: list[Any] = []

        async def send(message: Any) -> None:
            sent.append(message)

        scope = {
            "type": "http",
            "method": method,
            "path": path,
            "client": (address, 1),
            "headers": [
                (name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()
            ],
        }
        await self.gate(scope, None, send)
        body = sent[1]["body"].decode() if len(sent) > 1 else ""
        return sent[0]["status"], dict(sent[0]["headers"]), body


async def test_after_a_burst_an_address_comes_in_at_the_pace_of_people():
    caller = Caller(site := Site())
    for _ in range(BURST):
        assert (await caller.call())[0] == 200
    status, headers, words = await caller.call()
    assert status == 429
    assert headers[b"retry-after"] == b"3"
    assert "Wait 3 seconds" in words
    assert (await caller.call("192.0.2.2"))[0] == 200  # others come in
    caller.now_s += INTERVAL_S
    assert [(await caller.call())[0] for _ in range(2)] == [200, 429]
    caller.now_s += BURST * INTERVAL_S
    assert [(await caller.call())[0] for _ in range(BURST + 1)] == [200] * BURST + [429]
    assert site.entered == 2 * BURST + 2


async def test_a_flood_from_many_addresses_comes_in_at_a_pace_that_training_bears():
    caller = Caller(site := Site())
    answers = [(await caller.call(f"192.0.2.{number}"))[0] for number in range(2 * ALL_BURST)]
    assert answers == [200] * ALL_BURST + [429] * ALL_BURST
    for _ in range(3):
        caller.now_s += ALL_INTERVAL_S
        assert [(await caller.call(f"198.51.100.{n}"))[0] for n in range(2)] == [200, 429]
    caller.now_s += ALL_BURST * ALL_INTERVAL_S
    for _ in range(2 * BURST):
        await caller.call("203.0.113.1")  # who is refused alone takes no other's place
    assert (await caller.call("203.0.113.2"))[0] == 200
    assert site.entered == ALL_BURST + 3 + BURST + 1


async def test_ten_strangers_shut_no_clinic_out():
    """A try a second each: of twelve tries with the right password seven were refused."""
    caller = Caller(Site())
    caller.lanes = {"192.168.7.20": 1, "192.168.8.20": 2}
    entered: dict[str, list[int]] = {address: [] for address in caller.lanes}
    for second in range(120):
        caller.now_s += 1
        strangers = [(await caller.call(f"192.0.2.{number}"))[0] for number in range(10)]
        if second % 2 == 0:
            for address, codes in entered.items():
                codes.append((await caller.call(address))[0])
    assert entered == dict.fromkeys(entered, [200] * 60)
    assert 429 in strangers  # it is a flood


async def test_who_floods_a_clinics_lane_shuts_out_that_clinic_alone():
    caller = Caller(site := Site())
    flood = [f"192.168.7.{number}" for number in range(3)]
    caller.lanes = dict.fromkeys(flood, 1) | {"192.168.8.20": 2}
    for number in range(ALL_BURST):
        await caller.call(f"192.0.2.{number}")
    for _ in range(20):
        for address in flood:
            await caller.call(address)
    assert site.entered == ALL_BURST + LANE_BURST
    assert (await caller.call("192.168.8.20"))[0] == 200
    caller.now_s += LANE_INTERVAL_S
    await caller.call("192.0.2.99")
    await caller.call("192.0.2.98")
    await caller.call("192.0.2.97")
    await caller.call("192.0.2.96")
    assert [(await caller.call(flood[0]))[0] for _ in range(2)] == [200, 429]


async def test_strangers_who_wait_take_no_place_of_a_clinics_lane():
    caller = Caller(site := Site(answers=False))
    caller.lanes = {"192.168.7.20": 1}
    calls = [
        asyncio.create_task(caller.call(f"192.0.2.{number}"))
        for number in range(AT_ONCE + MAX_WAITING)
    ]
    await asyncio.sleep(0)
    assert (await caller.call("198.51.100.1"))[0] == 429
    calls.append(asyncio.create_task(caller.call("192.168.7.20")))
    await asyncio.sleep(0)
    site.may_answer.set()
    assert {(await one)[0] for one in calls} == {200}


@pytest.mark.django_db
def test_a_browser_that_has_signed_in_keeps_its_clinics_lane(client, world):
    user = User.everywhere.create_user(
        "lea", password="walk well 2026", role=Role.PT, clinic=world.clinic
    )
    client.post("/sign-in/", {"username": "lea", "password": "wrong"})
    assert lane_of_browser(cookies_of(client)) is None
    client.post("/sign-in/", {"username": "lea", "password": "walk well 2026"})
    kept = cookies_of(client)
    assert lane_of_browser(kept) == user.clinic_id
    assert client.cookies[known_browsers.COOKIE]["path"] == "/sign-in/"
    assert (
        lane_of_browser(kept | {known_browsers.COOKIE: f"1{kept[known_browsers.COOKIE]}"}) is None
    )
    with time_machine.travel(timezone.now() + timedelta(days=31)):
        assert lane_of_browser(kept) is None


def cookies_of(client: Any) -> dict[str, str]:
    return {name: morsel.value for name, morsel in client.cookies.items()}


@pytest.mark.django_db(transaction=True)
@pytest.mark.postgres
async def test_a_network_from_which_somebody_signed_in_lately_keeps_its_clinics_lane(world):
    lanes, address = Lanes(), "203.0.113.9"
    assert await lanes.find({}, address) is None
    sign_in = sync_to_async(AuditEntry.everywhere.create)
    entry = {"act": Act.SIGN_IN, "clinic": world.clinic, "address": "203.0.113.0/24"}
    await sign_in(**entry, at=timezone.now() - timedelta(days=31))
    assert await Lanes().find({}, address) is None
    await sign_in(**entry, at=timezone.now() - timedelta(days=29))
    assert await lanes.find({}, address) is None  # it was read a moment ago
    assert await Lanes().find({}, address) == world.clinic.pk
    await sign_in(act=Act.SIGN_IN, clinic=None, address="203.0.113.0/24")
    assert await Lanes().find({}, address) == known_browsers.HOSTS


async def test_only_attempts_to_sign_in_are_counted():
    caller = Caller(Site())
    for _ in range(3 * BURST):
        assert (await caller.call(method="GET"))[0] == 200
        assert (await caller.call(path="/api/v1/patients"))[0] == 200
    assert (await caller.call(path="/sign-in/code/"))[0] == 200


async def test_from_all_addresses_a_few_are_inside_and_a_few_wait():
    caller = Caller(site := Site(answers=False))
    calls = [
        asyncio.create_task(caller.call(f"192.0.2.{number}"))
        for number in range(AT_ONCE + MAX_WAITING)
    ]
    await asyncio.sleep(0)
    assert (await caller.call("198.51.100.1"))[0] == 429
    site.may_answer.set()
    assert {(await one)[0] for one in calls} == {200}
    assert site.most_at_once == AT_ONCE
    assert (await caller.call("198.51.100.1"))[0] == 200  # there is room again


async def test_the_address_is_the_one_that_our_proxy_saw(settings):
    settings.PROXIES = 1
    caller = Caller(Site())
    for number in range(BURST):
        assert (await caller.call(x_forwarded_for=f"10.0.0.{number}, 203.0.113.9"))[0] == 200
    assert (await caller.call(x_forwarded_for="10.9.9.9, 203.0.113.9"))[0] == 429
    assert (await caller.call(x_forwarded_for="10.9.9.9, 203.0.113.8"))[0] == 200


@pytest.mark.parametrize("languages", ["es-MX,es;q=0.9", "xx, es"])
async def test_who_is_refused_reads_why_in_the_own_language(languages):
    caller = Caller(Site())
    for _ in range(BURST):
        await caller.call()
    assert "segundos" in (await caller.call(accept_language=languages))[2]


# --- hashing ------------------------------------------------------------------------------------


def test_so_many_passwords_are_hashed_at_once_so_many_wait_and_no_more():
    pool = HashingPool(workers=2, waiting=1)
    go_on, running = threading.Event(), threading.Semaphore(0)

    def work() -> str:
        running.release()
        assert go_on.wait(20)
        return threading.current_thread().name

    callers = [threading.Thread(target=pool.run, args=[work]) for _ in range(2)]
    for caller in callers:
        caller.start()
    for _ in callers:
        assert running.acquire(timeout=20)
    waiting = threading.Thread(target=pool.run, args=[lambda: None])
    waiting.start()
    while pool._places._value:
        pass
    with pytest.raises(HashingBusy):
        pool.run(lambda: None)
    go_on.set()
    for thread in (*callers, waiting):
        thread.join(20)
    assert pool.run(work).startswith("hashing")


@pytest.mark.django_db
def test_a_password_that_cannot_be_checked_now_is_no_wrong_one(client, settings, monkeypatch):
    settings.PASSWORD_HASHERS = ["rehab.people.sign_in.hashing.PooledArgon2PasswordHasher"]
    User.everywhere.create_user("host", password="walk well 2026", role=Role.HOST)
    full = HashingPool(workers=1, waiting=0)
    full._places.acquire()
    monkeypatch.setattr(hashing, "pool", full)
    form = {"username": "host", "password": "walk well 2026"}
    for _ in range(6):
        answer = client.post("/sign-in/", form)
        assert answer.status_code == 429
        assert answer.headers["Retry-After"] == "5"
        assert "Too many people are signing in" in answer.content.decode()
    full._places.release()
    assert client.post("/sign-in/", form).status_code == 302


def test_hashes_of_the_pool_are_djangos():
    hasher = hashing.PooledArgon2PasswordHasher()
    encoded = hasher.encode("walk well", hasher.salt())
    assert encoded.startswith("argon2$argon2id$")
    assert hasher.verify("walk well", encoded)
    assert not hasher.verify("walk wel", encoded)
    assert not lockout.lockout_s(RequestFactory().get("/"))
