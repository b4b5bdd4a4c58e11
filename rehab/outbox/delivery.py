"""Sends what waits in the outbox, one message after the other, in a thread of its own."""

from __future__ import annotations

import hashlib
import hmac
import json
from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping
from datetime import datetime, timedelta
from typing import NamedTuple

from cryptography.fernet import InvalidToken
from django.conf import settings
from django.db.models import QuerySet

from rehab.outbox.http_post import Answer, Refused, post
from rehab.outbox.models import MAX_ANSWER_CHARS, Endpoint, OutboxMessage

CLAIMED_FOR = timedelta(minutes=2)  # by a server, which may die meanwhile
BATCH = 20
# After each failed attempt; then a message waits for a person. By the example of Standard Webhooks.
PAUSES = [timedelta(seconds=s) for s in (5, 60, 300, 1800, 7200, 18000, 36000, 50400, 72000, 86400)]
# Answers by which a receiver says that no repetition helps; 410 also ends the receiver.
GONE = 410
REFUSALS = {400, 401, 403, 404, 405, 413, 415, 422, GONE}


class Request(NamedTuple):
    """What is posted to a receiver."""

    body: bytes
    headers: Mapping[str, str]


class NothingToSend(Exception):
    """A message is not to be sent any more; the message says why."""


def sign(secret: str, key: str, timestamp: int, body: bytes) -> str:
    """Return a signature by Standard Webhooks: HMAC-SHA256 of key, time and body.

    Source: standardwebhooks.com, specification 1.0.
    """
    signed = b".".join((key.encode(), str(timestamp).encode(), body))
    mac = hmac.new(b64decode(secret.removeprefix("whsec_")), signed, hashlib.sha256)
    return f"v1,{b64encode(mac.digest()).decode()}"


def write_webhook(message: OutboxMessage, now: datetime) -> Request:
    """Return a message as a signed webhook."""
    content = {"type": message.topic, "timestamp": message.at.isoformat(), "data": message.body}
    body = json.dumps(content, separators=(",", ":")).encode()
    at = int(now.timestamp())
    headers = {
        "Content-Type": "application/json",
        "webhook-id": message.key,
        "webhook-timestamp": str(at),
        "webhook-signature": sign(message.endpoint.open_secret(), message.key, at, body),
    }
    return Request(body, headers)


# How a message is written for each kind of receiver; rooms above add theirs when the app starts.
WRITERS: dict[str, Callable[[OutboxMessage, datetime], Request]] = {
    Endpoint.Kind.WEBHOOK: write_webhook
}


def is_due(now: datetime) -> bool:
    """Return whether anything is to be sent."""
    return _find_due(now).exists()


def _find_due(now: datetime) -> QuerySet[OutboxMessage]:
    return OutboxMessage.everywhere.filter(
        state=OutboxMessage.State.WAITING, due_at__lte=now, endpoint__active=True
    )


def deliver_due(now: datetime, send: Callable[..., Answer] = post) -> int:
    """Send what is due; return how many messages were delivered.

    A receiver that fails gets no more until the next call. Several servers may call this at once:
    each message is claimed by one of them.
    """
    delivered, failing = 0, set[int]()
    due = _find_due(now).select_related("endpoint").order_by("due_at", "pk")
    for message in due[:BATCH]:
        if message.endpoint_id in failing:
            continue
        same = OutboxMessage.everywhere.filter(pk=message.pk, state=message.state)
        if not same.filter(due_at=message.due_at).update(due_at=now + CLAIMED_FOR):
            continue
        if _attempt(message, now, send):
            delivered += 1
        else:
            failing.add(message.endpoint_id)
    return delivered


def _attempt(message: OutboxMessage, now: datetime, send: Callable[..., Answer]) -> bool:
    """Send a message and store what that came to. Return whether it was received."""
    endpoint, is_final, is_delivered = message.endpoint, False, False
    try:
        request = WRITERS[endpoint.kind](message, now)
        answer = send(endpoint.url, request.body, request.headers, settings.PRIVATE_RECEIVERS)
    except (Refused, NothingToSend) as problem:
        words, is_final = str(problem), True
    except InvalidToken:
        words, is_final = "The server has another key now. Give the receiver a new secret.", True
    except (OSError, ValueError) as problem:
        words = str(problem)
    else:
        is_final, is_delivered = answer.status in REFUSALS, 200 <= answer.status < 300
        said = "" if is_delivered else _tell_why(endpoint, answer)
        words = f"{answer.status} {said}".strip()
        if answer.status == GONE:
            endpoint.active = False
            endpoint.save(update_fields=["active"])
    message.attempts += 1
    message.answer = words[:MAX_ANSWER_CHARS]
    if is_delivered:
        message.state = message.State.DELIVERED
    elif is_final or message.attempts > len(PAUSES):
        message.state = message.State.REFUSED
    else:
        message.due_at = now + PAUSES[message.attempts - 1]
    message.save(update_fields=["attempts", "answer", "state", "due_at"])
    return is_delivered


def _tell_why(endpoint: Endpoint, answer: Answer) -> str:
    """Return why a message was refused; of a FHIR server no words, which may name the patient."""
    if endpoint.kind != Endpoint.Kind.FHIR:
        return answer.text
    try:
        issues = json.loads(answer.text)["issue"]
        places = (f"{one['code']} {' '.join(one.get('expression', ()))}" for one in issues)
        return "; ".join(place.strip() for place in places)
    except (ValueError, KeyError, TypeError, AttributeError):
        return ""
