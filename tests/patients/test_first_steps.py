"""A sensor that is not connected: the first steps lead to its line, not to another sensor."""

from __future__ import annotations

import re

import pytest
from django.utils import timezone

from rehab.stations.models import Device, Station

pytestmark = pytest.mark.django_db

SENSOR = "/first-steps/?step=sensor"
LINE = "Make a new start command"


@pytest.fixture
def device(world):
    Device.everywhere.filter(clinic=world.clinic).update(revoked_at=timezone.now())
    station = Station.everywhere.create(clinic=world.clinic, name="Treadmill")
    device = Device(clinic=world.clinic, station=station, kind=Device.Kind.SOURCE, name="Plates")
    device.new_token()
    device.save()
    return device


def test_a_lead_is_shown_the_line_of_a_sensor_that_is_not_connected(world, device):
    page = world.lead.get(SENSOR).content.decode()
    assert "Not connected now: Plates" in page
    assert "python -m rehab.sources … --stay --server http://testserver --token …" in page
    assert page.index("--token …") < page.index("Command lost?") < page.index(LINE)
    [form] = re.findall(r'action="([^"]+)">(?:(?!</form>).)*' + LINE, page, re.DOTALL)
    answer = world.lead.post(form, {"renew": ""}).content.decode()
    before = device.token_hash
    device.refresh_from_db()
    assert device.token_hash != before
    assert "Start its program" in answer


def test_a_therapist_is_told_who_does_it(world, device):
    page = world.pt.get(SENSOR).content.decode()
    assert LINE not in page
    assert "Your clinic’s lead does this." in page


def test_a_phone_is_paired_again(world, device):
    Device.everywhere.filter(pk=device.pk).update(place="shank", side="left")
    assert LINE not in world.lead.get(SENSOR).content.decode()
