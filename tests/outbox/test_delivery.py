"""Messages to receivers: stored with what they report, signed, tried again, replayed."""

from __future__ import annotations

import base64
import json
from datetime import timedelta
from http.server import BaseHTTPRequestHandler, HTTPServer
from threading import Thread

import pytest
from django.core.management import CommandError, call_command
from django.db import transaction
from django.urls import reverse
from django.utils import timezone
from django.utils.formats import localize

from rehab.exports.encryption import generate_key
from rehab.outbox.delivery import PAUSES, deliver_due, is_due, sign
from rehab.outbox.http_post import Answer, Refused
from rehab.outbox.models import Endpoint, OutboxMessage, Topic, notify
from rehab.people.roles import Role
from rehab.sessions.live.session.aggregate import Row, SessionAggregate
from rehab.sessions.log import Remark
from rehab.training.changes import Change, ChangeKind
from tests.support.clock import START as NOW
from tests.support.walks import walk
from tests.support.world import build_world, store

pytestmark = pytest.mark.django_db


def add_endpoint(world, **fields):
    usual = {"name": "Hook", "url": "https://hook.example/in"}
    endpoint = Endpoint(clinic=world.clinic, **usual | fields)
    endpoint.new_secret()
    endpoint.save()
    return endpoint


@pytest.fixture
def endpoint(world):
    return add_endpoint(world)


class Receiver:
    """Answers what it is told to, and remembers what it received."""

    def __init__(self, *answers):
        self.answers = list(answers)
        self.received = []

    def __call__(self, url, body, headers, allowed):
        answer = self.answers.pop(0) if self.answers else 200
        if isinstance(answer, Exception):
            raise answer
        self.received.append((body, headers))
        return Answer(answer, "no more" if answer >= 300 else "")


def messages(endpoint):
    return OutboxMessage.everywhere.filter(endpoint=endpoint).order_by("pk")


def test_a_session_and_a_fall_are_told_and_name_no_patient(world, endpoint):
    session = walk(world.patient, "binary", [4.0] * 4, end=None)
    aggregate = SessionAggregate.load(session)
    rows: list[Row] = [aggregate.log_event(Remark.FALL, None, NOW, {})]
    rows += aggregate.change(Change(ChangeKind.FINISH), None, NOW)
    store(aggregate, rows)
    assert [one.topic for one in messages(endpoint)] == ["patient.fall", "session.ended"]
    receiver = Receiver()
    assert deliver_due(NOW + timedelta(hours=1), receiver) == 2
    ended = json.loads(receiver.received[1][0])
    assert ended["data"] == {"session": session.pk, "station": None, "how": "finish"}
    sent = b"".join(body for body, _ in receiver.received)
    assert world.patient.nickname.encode() not in sent
    assert world.patient.pseudonym.encode() not in sent


def test_what_nobody_walked_is_told_as_simulated(world, endpoint):
    walk(world.patient, "binary", [4.0] * 4, simulated=True)
    (message,) = messages(endpoint)
    assert message.body["simulated"] is True


def test_what_is_rolled_back_is_not_told(world, endpoint):
    with transaction.atomic():
        notify(world.clinic.pk, Topic.EXPORT, {}, NOW)
        transaction.set_rollback(True)
    assert not is_due(NOW)


def test_the_reference_library_verifies_a_signature(world, endpoint):
    standardwebhooks = pytest.importorskip("standardwebhooks")
    notify(world.clinic.pk, Topic.EXPORT, {"sessions": 3}, NOW)
    receiver = Receiver()
    deliver_due(NOW, receiver)
    ((body, headers),) = receiver.received
    webhook = standardwebhooks.Webhook(endpoint.open_secret())
    assert webhook.verify(body, dict(headers))["data"] == {"sessions": 3}
    with pytest.raises(standardwebhooks.WebhookVerificationError):
        webhook.verify(body + b" ", dict(headers))


def test_the_example_of_the_specification():
    secret = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"
    body = b'{"test": 2432232314}'
    signature = "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="
    assert sign(secret, "msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330, body) == signature


def test_an_hour_away_loses_nothing_and_keeps_the_key(world, endpoint):
    for number in range(3):
        notify(world.clinic.pk, Topic.EXPORT, {"sessions": number}, NOW)
    keys = [one.key for one in messages(endpoint)]
    away, now = Receiver(*[OSError("no route")] * 1000), NOW
    while now < NOW + timedelta(hours=1):
        assert deliver_due(now, away) == 0
        now += timedelta(seconds=5)
    back = Receiver()
    while is_due(now) or messages(endpoint).filter(state="waiting").exists():
        deliver_due(now, back)
        now += timedelta(minutes=10)
    assert sorted(headers["webhook-id"] for _, headers in back.received) == sorted(keys)
    assert {one.state for one in messages(endpoint)} == {"delivered"}


def test_a_receiver_that_never_answers_is_given_up_and_can_be_told_again(world, endpoint):
    notify(world.clinic.pk, Topic.EXPORT, {}, NOW)
    now = NOW
    for _ in range(len(PAUSES) + 1):
        deliver_due(now, Receiver(503))
        now += PAUSES[-1]
    message = messages(endpoint).get()
    assert (message.state, message.attempts) == ("refused", len(PAUSES) + 1)
    assert message.answer == "503 no more"
    address = reverse("admin:rehab_outboxmessage_changelist")
    world.lead.post(address, {"action": "send_again", "_selected_action": [message.pk]})
    assert deliver_due(now + timedelta(days=400), Receiver()) == 1


@pytest.mark.parametrize(("status", "active"), [(400, True), (404, True), (410, False)])
def test_a_refusal_is_final_and_shown(world, endpoint, status, active):
    notify(world.clinic.pk, Topic.EXPORT, {}, NOW)
    deliver_due(NOW, Receiver(status))
    endpoint.refresh_from_db()
    assert messages(endpoint).get().state == "refused"
    assert endpoint.active == active
    page = world.lead.get(reverse("admin:rehab_outboxmessage_changelist")).content.decode()
    assert f"{status} no more" in page


@pytest.mark.parametrize("cause", ["address", "key"])
def test_what_never_can_be_sent_is_refused_at_once(world, endpoint, cause):
    for _ in range(2):
        notify(world.clinic.pk, Topic.EXPORT, {}, NOW)
    if cause == "key":
        Endpoint.everywhere.filter(pk=endpoint.pk).update(secret="of another key")
    assert deliver_due(NOW, Receiver(Refused("A private address."))) == 0
    assert [one.state for one in messages(endpoint)] == ["refused", "waiting"]  # one each call
    words = {"address": "A private address.", "key": "Give the receiver a new secret."}[cause]
    assert words in messages(endpoint)[0].answer


def test_a_new_secret_signs_from_then_on(world, endpoint):
    old, address = endpoint.open_secret(), reverse("admin:rehab_endpoint_changelist")
    page = world.lead.post(address, {"action": "renew_secrets", "_selected_action": [endpoint.pk]})
    endpoint.refresh_from_db()
    assert endpoint.open_secret() != old
    assert endpoint.open_secret() in page.content.decode()


def test_a_message_is_claimed_by_one_server(world, endpoint):
    notify(world.clinic.pk, Topic.EXPORT, {}, NOW)
    inner = Receiver()

    def meanwhile(*arguments):
        assert deliver_due(NOW, inner) == 0  # another server, while this one waits for an answer
        return Answer(200, "")

    assert deliver_due(NOW, meanwhile) == 1
    assert inner.received == []


def test_a_receiver_that_fails_does_not_hold_up_another(world, endpoint):
    add_endpoint(world, name="Second")
    for _ in range(2):
        notify(world.clinic.pk, Topic.EXPORT, {}, NOW)
    assert deliver_due(NOW, Receiver(OSError("away"), 200, 200)) == 2


def test_another_clinic_is_told_nothing(world, endpoint):
    other = build_world("basil")
    walk(other.patient, "binary", [4.0] * 4)
    assert not messages(endpoint).exists()
    page = other.lead.get(reverse("admin:rehab_endpoint_change", args=[endpoint.pk]))
    assert page.status_code in (302, 404)


def test_a_failed_backup_is_told(world, endpoint, settings, tmp_path, monkeypatch):
    settings.BACKUP_KEYS = [generate_key()[1]]

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("rehab.management.commands.backup.write_backup", fail)
    with pytest.raises(CommandError, match="cannot be written"):
        call_command("backup", str(tmp_path / "all.age"))
    assert messages(endpoint).get().body == {"problem": "CommandError"}


def test_a_lead_adds_a_receiver_and_sees_its_secret_once(world):
    form = {"name": "EHR", "kind": "webhook", "url": "https://ehr.example/", "active": "on"}
    page = world.lead.post(reverse("admin:rehab_endpoint_add"), form, follow=True)
    endpoint = Endpoint.everywhere.get(name="EHR")
    secret = endpoint.open_secret()
    assert len(base64.b64decode(secret.removeprefix("whsec_"))) == 32
    assert secret in page.content.decode()
    assert secret not in endpoint.secret
    page = world.lead.get(reverse("admin:rehab_endpoint_change", args=[endpoint.pk]))
    assert secret not in page.content.decode()
    for role in (Role.PT, Role.RESEARCHER):
        client = world.pt if role is Role.PT else None
        if client is not None:
            assert client.get(reverse("admin:rehab_endpoint_changelist")).status_code == 403


class Hook(BaseHTTPRequestHandler):
    received: list[bytes] = []

    def do_POST(self):
        self.received.append(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_response(204)
        self.end_headers()

    def log_message(self, *_):
        pass


def test_a_stored_token_goes_to_no_other_address(world):
    endpoint = add_endpoint(world, kind=Endpoint.Kind.FHIR)
    page = reverse("admin:rehab_endpoint_change", args=[endpoint.pk])
    form = {"name": "Hook", "url": "https://elsewhere.example/in", "active": "on"}
    assert "give the token again" in world.lead.post(page, form).content.decode()
    assert world.lead.post(page, form | {"url": endpoint.url, "name": "EHR"}).status_code == 302
    kept = Endpoint.everywhere.get(pk=endpoint.pk)
    assert (kept.name, kept.open_secret()) == ("EHR", endpoint.open_secret())
    assert world.lead.post(page, form | {"token": "its-own"}).status_code == 302
    moved = Endpoint.everywhere.get(pk=endpoint.pk)
    assert (moved.url, moved.open_secret()) == (form["url"], "its-own")


def test_over_a_real_socket_where_the_host_allows_the_network(world, settings):
    with HTTPServer(("127.0.0.1", 0), Hook) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        endpoint = add_endpoint(world, url=f"http://127.0.0.1:{server.server_port}/hook")
        notify(world.clinic.pk, Topic.EXPORT, {"sessions": 1}, NOW)
        assert deliver_due(NOW) == 0
        assert "GARRY_PRIVATE_RECEIVERS" in messages(endpoint).get().answer
        messages(endpoint).get().send_again(NOW)
        settings.PRIVATE_RECEIVERS = ["127.0.0.0/8"]
        assert deliver_due(NOW) == 1
        server.shutdown()
    assert json.loads(Hook.received[0])["type"] == "export.ready"


def test_a_receivers_page_asks_for_what_its_kind_has(world, endpoint):
    fhir = add_endpoint(world, name="EHR", kind=Endpoint.Kind.FHIR)
    shown = {
        row.kind: world.lead.get(
            reverse("admin:rehab_endpoint_change", args=[row.pk])
        ).content.decode()
        for row in (endpoint, fhir)
    }
    assert ("id_token" in shown["webhook"], "id_wants_falls" in shown["webhook"]) == (False, True)
    assert ("id_token" in shown["fhir"], "id_wants_falls" in shown["fhir"]) == (True, False)
    before = fhir.open_secret()
    address = reverse("admin:rehab_endpoint_changelist")
    form = {"action": "renew_secrets", "_selected_action": [fhir.pk]}
    assert "its own" in world.lead.post(address, form, follow=True).content.decode()
    assert Endpoint.everywhere.get(pk=fhir.pk).open_secret() == before


def test_only_what_waits_has_a_next_attempt(world, endpoint):
    notify(world.clinic.pk, Topic.EXPORT, {}, NOW)
    message = messages(endpoint).get()
    page = reverse("admin:rehab_outboxmessage_change", args=[message.pk])
    line = '<div class="readonly">{}</div>'
    due = line.format(localize(timezone.localtime(message.due_at)))
    assert world.lead.get(page).content.decode().count(due) == 2  # and when it was stored
    deliver_due(NOW, Receiver(400))
    shown = world.lead.get(page).content.decode()
    assert shown.count(due) == 1
    assert line.format("–") in shown
