"""A control is one entry of the registry: a planted one works from the request to the mark."""

from __future__ import annotations

import json
import re

import pytest
from asgiref.sync import sync_to_async
from django.test import Client
from django.urls import reverse

from rehab.sessions.live import runtime
from rehab.sessions.log import SessionEvent
from rehab.sessions.reports.review import review_session
from rehab.sessions.schemas import parse_change_kind
from rehab.training.changes import ChangeKind
from rehab.training.controls import (
    CONTROLS,
    Audience,
    ChartMark,
    Control,
    Payload,
    Requester,
    ValueFormat,
    ValueKind,
)
from rehab.training.measures import InvalidSetting
from tests.support.callers import restart, sign_in


def check_cadence(steps_a_minute: float) -> float:
    if not 30 <= steps_a_minute <= 180:
        raise InvalidSetting("A cadence lies between 30 and 180 steps a minute.")
    return float(steps_a_minute)


CADENCE = Control(
    kind="cadence",
    log_label="cadence",
    review_label="Cadence",
    value=ValueKind.NUMBER,
    check=check_cadence,
    initial=lambda _plan: 60.0,
    payloads={
        Audience.PATIENT: Payload.STATE,
        Audience.MONITOR: Payload.VALUE,
        Audience.SOURCE: Payload.VALUE,
    },
    event_field="steps_a_minute",
    snapshot_field="cadence",
    requesters=frozenset({Requester.MONITOR}),
    value_format=ValueFormat.NUMBER,
    shows_old=True,
    mark=ChartMark("M", "metronome", ValueFormat.NUMBER),
)


@pytest.fixture(autouse=True)
def planted(monkeypatch):
    monkeypatch.setitem(CONTROLS, "cadence", CADENCE)


def test_every_kind_that_code_names_has_its_control():
    assert set(ChangeKind) <= set(CONTROLS)
    assert all(kind == control.kind for kind, control in CONTROLS.items())


async def test_a_planted_control_needs_no_other_code(place, begun):
    session = await begun(place)
    monitor, tablet, source = place.monitor(session), place.tablet(session), place.source()
    assert (await monitor.watch())["cadence"] == 60
    assert "cadence" not in await tablet.watch()
    await (await source.dial()).hello()
    await source.walk(4.0)

    # Requests: who may ask, and for which values.
    assert parse_change_kind("cadence") == "cadence"
    await tablet.say({"type": "change", "kind": "cadence", "value": 80, "id": "t"})
    assert (await tablet.hear("error"))["code"] == "refused"
    assert "between 30 and 180" in (await monitor.change("cadence", 300))["message"]
    assert "needs a value" in (await monitor.change("cadence"))["message"]
    assert (await monitor.change("cadence", 80))["type"] == "done"

    # The fold, and the event for each audience.
    live = await runtime.current().session(session.pk)
    assert live.aggregate.fold.settings["cadence"] == 80
    told = await monitor.until(lambda event: event["kind"] == "cadence")
    mark = {"after": 1, "kind": "cadence", "value": 80}
    assert told == {"kind": "cadence", "steps_a_minute": 80, "mark": mark}
    assert (await tablet.until(lambda event: event["kind"] == "state"))["state"] == "running"
    assert (await source.hear("cadence"))["steps_a_minute"] == 80

    # The log, and its replay.
    row = await SessionEvent.everywhere.aget(session=session, kind="cadence")
    assert (row.old, row.value, row.after_number, row.data) == (60, 80, 1, {})
    await restart()
    again = await place.monitor(session).watch()
    assert again["cadence"] == 80
    assert mark in again["marks"]

    # The review, and what scripts need to draw the mark.
    review = await sync_to_async(review_session)(place.pt, session)
    assert "Cadence 60.00 → 80.00" in [event.text for event in review.events]
    assert "cadence" in [mark["kind"] for mark in review.chart["marks"]]
    page = await sync_to_async(open_monitor)(place.pt, session)
    marks = json.loads(re.search(r'<script id="chart-marks"[^>]*>(.*?)</script>', page)[1])
    assert marks["cadence"] == {
        "badge": "M",
        "label": "metronome",
        "format": "number",
        "choices": {},
    }
    assert marks["robot_intensity"]["choices"] == {"1": "normal", "0.5": "gentle", "0": "off"}


def open_monitor(user, session):
    client = Client()
    client.cookies["sessionid"] = sign_in(user)
    return client.get(reverse("monitor", args=[session.pk])).content.decode()
