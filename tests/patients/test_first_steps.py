"""A sensor that is not connected: the first steps lead to its line, not to another sensor."""

from __future__ import annotations

import re

import pytest
from django.utils import timezone

from rehab.people.roles import Role
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
    assert page.index("the command that you copied") < page.index("Is it lost?") < page.index(LINE)
    assert "--token" not in page  # no line with gaps
    [form] = re.findall(r'action="([^"]+)">(?:(?!</form>).)*' + LINE, page, re.DOTALL)
    answer = world.lead.post(form, {"renew": ""}).content.decode()
    before = device.token_hash
    device.refresh_from_db()
    assert device.token_hash != before
    assert "Start its program" in answer
    # What a clinic has its own of is filled in beside its line.
    assert 'data-fills="port"' in answer
    assert 'udp://0.0.0.0:<b data-blank="port">9101</b>' in answer


def test_a_tablet_that_was_let_in_is_done_though_it_is_off(world, device):
    tablets = Device.everywhere.filter(pk=device.pk)
    tablets.update(kind=Device.Kind.TABLET, approver=world.people[Role.LEAD])
    page = world.lead.get("/first-steps/?step=tablet").content.decode()
    assert re.search(r'data-step="tablet"\s+class="done"', page)
    assert re.search(r'data-step="sensor"\s+class="next"', page)
    # One whose approver is gone has to be let in again.
    tablets.update(approver=None)
    page = world.lead.get("/first-steps/?step=tablet").content.decode()
    assert re.search(r'data-step="tablet"\s+class="next"', page)


def test_a_therapist_is_told_who_does_it(world, device):
    page = world.pt.get(SENSOR).content.decode()
    assert LINE not in page
    assert "Your clinic’s lead does this." in page


def test_a_phone_is_paired_again(world, device):
    Device.everywhere.filter(pk=device.pk).update(place="shank", side="left")
    assert LINE not in world.lead.get(SENSOR).content.decode()
