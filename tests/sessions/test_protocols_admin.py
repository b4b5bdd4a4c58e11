"""Protocols are built row by row, and told as they will be walked."""

from __future__ import annotations

import json
import re

import pytest
from django.urls import reverse

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.sessions.setup.protocol_models import Protocol, ProtocolPhase
from rehab.sessions.setup.protocol_outline import describe_phase_end
from rehab.training.phases import Phase
from tests.support.admin_actions import act
from tests.support.world import World, build_world, client_of

pytestmark = pytest.mark.django_db


@pytest.fixture
def protocol(world) -> Protocol:
    made = Protocol.everywhere.create(clinic=world.clinic, name="Blocks")
    for position, name in enumerate(("Warm up", "Block", "Rest"), 1):
        made.phases.create(
            position=position, kind="training", name=name, feedback=True, seconds=60 * position
        )
    return made


def rows(protocol: Protocol, *phases: dict[str, object]) -> dict[str, object]:
    """Return the form of a protocol with these phases."""
    stored = protocol.phases.count() if protocol.pk else 0
    form: dict[str, object] = {
        "name": protocol.name,
        "description": "",
        "phases-TOTAL_FORMS": len(phases),
        "phases-INITIAL_FORMS": stored,
        "phases-MIN_NUM_FORMS": 0,
        "phases-MAX_NUM_FORMS": 1000,
    }
    for index, phase in enumerate(phases):
        values = {"kind": "training", "feedback": "on", "gain": "90", **phase}
        form |= {f"phases-{index}-{name}": value for name, value in values.items()}
        form[f"phases-{index}-protocol"] = protocol.pk or ""
    return form


def told(protocol: Protocol) -> list[tuple[int, str]]:
    return list(protocol.phases.order_by("position").values_list("position", "name"))


def save(world: World, protocol: Protocol, *phases: dict[str, object]):
    url = reverse("admin:rehab_protocol_change", args=[protocol.pk])
    return client_of(world).post(url, rows(protocol, *phases))


def test_phases_change_places_and_new_ones_come_between(world, protocol):
    warm, block, rest = protocol.phases.order_by("position")
    answer = save(
        world,
        protocol,
        {"id": warm.pk, "name": "Warm up", "position": 3, "seconds": 60},
        {"id": block.pk, "name": "Block", "position": 1, "seconds": 120},
        {"id": rest.pk, "name": "Rest", "position": 4, "seconds": 180},
        {"name": "Catch", "position": 2, "strides": 12},
    )
    assert answer.status_code == 302, answer.content.decode()
    assert told(protocol) == [(1, "Block"), (2, "Catch"), (3, "Warm up"), (4, "Rest")]
    assert set(protocol.phases.values_list("gain", flat=True)) == {0.9}  # the form's 90 %
    assert {warm.pk, block.pk, rest.pk} < set(protocol.phases.values_list("pk", flat=True))


def test_a_row_without_a_number_follows_the_one_above_and_gaps_close(world, protocol):
    warm, block, rest = protocol.phases.order_by("position")
    save(
        world,
        protocol,
        {"id": warm.pk, "name": "Warm up", "position": 1, "DELETE": "on"},
        {"id": block.pk, "name": "Block", "position": 2, "seconds": 120},
        {"id": rest.pk, "name": "Rest", "position": 7, "seconds": 180},
        {"name": "Washout", "position": ""},
    )
    assert told(protocol) == [(1, "Block"), (2, "Rest"), (3, "Washout")]


def test_a_protocol_without_phases_and_a_phase_that_cannot_be_walked_are_refused(world, protocol):
    phases = list(protocol.phases.order_by("position"))
    gone = [{"id": p.pk, "name": p.name, "position": p.position, "DELETE": "on"} for p in phases]
    assert "needs at least one phase" in save(world, protocol, *gone).content.decode()
    kept = [{"id": p.pk, "name": p.name, "position": p.position, "gain": "160"} for p in phases]
    assert save(world, protocol, *kept).status_code == 200
    assert told(protocol) == [(1, "Warm up"), (2, "Block"), (3, "Rest")]


def test_what_is_drawn_is_what_is_stored(world, protocol):
    url = reverse("admin:rehab_protocol_change", args=[protocol.pk])
    page = client_of(world).get(url).content.decode()
    phases = json.loads(re.search(r'<script id="phases"[^>]*>(.*?)</script>', page, re.DOTALL)[1])
    assert [phase["name"] for phase in phases] == ["Warm up", "Block", "Rest"]
    assert phases[1] | {"kind": "training"} == {
        "kind": "training",
        "name": "Block",
        "feedback": True,
        "gain": 1.0,
        "strides": None,
        "seconds": 120.0,
        "goal_percent": None,
        "robot": True,
        "rest_s": None,
    }


def test_the_form_has_whole_numbers_and_the_gain_in_percent(world, protocol):
    url = reverse("admin:rehab_protocol_change", args=[protocol.pk])
    form = client_of(world).get(url).context["inline_admin_formsets"][0].formset.forms[0]
    assert (form["gain"].value(), form["seconds"].value()) == (100, 60)


def test_what_can_only_be_read_is_in_words(world):
    shared = Protocol.everywhere.get(clinic=None, name="Baseline, training, washout")
    page = client_of(world).get(f"/admin/rehab/protocol/{shared.pk}/change/").content.decode()
    cells = re.findall(r"<td class=\"field-\w+\">\s*<p>(.*?)</p>", page)
    assert cells[:4] == ["Baseline", "no", "100 %", "54 strides, about 1\xa0min"]
    assert cells[4:7] == ["stays", "yes", "none"]


@pytest.mark.parametrize(
    ("seconds", "written"), [(45, "45 s"), (60, "1 min"), (75, "1:15 min"), (600, "10 min")]
)
def test_a_time_that_was_set_is_told_to_the_second(seconds, written):
    phase = Phase(kind="washout", name="Washout", feedback=False, seconds=seconds)
    assert describe_phase_end(phase) == written.replace(" ", "\xa0")


def test_a_shared_protocol_is_read_and_drawn_in_the_pages_language(world):
    shared = Protocol.everywhere.get(clinic=None, name="Baseline, training, washout")
    User.everywhere.filter(pk=world.people[Role.LEAD].pk).update(language="es")
    url = f"/admin/rehab/protocol/{shared.pk}/change/"
    page = client_of(world, Role.LEAD).get(url).content.decode()
    for english in ("Baseline", "Washout", "A minute without feedback"):
        assert english not in page
    assert page.count("Línea base") >= 3  # in the title, its row and the drawing's data


def test_a_shared_protocol_is_copied_and_the_copy_is_the_clinics(world):
    shared = Protocol.everywhere.get(name="Baseline, training, washout", clinic=None)
    page = client_of(world).get(reverse("admin:rehab_protocol_change", args=[shared.pk]))
    assert "Copy to my clinic" in page.content.decode()
    answer = act(world, "protocol", "copy_to_clinic", shared.pk)
    copy = Protocol.everywhere.get(clinic=world.clinic, name=f"{shared.name} (copy 1)")
    assert answer.headers["Location"] == reverse("admin:rehab_protocol_change", args=[copy.pk])
    assert copy.to_rules() == shared.to_rules()
    act(world, "protocol", "copy_to_clinic", shared.pk)
    assert Protocol.everywhere.filter(clinic=world.clinic, name__endswith="(copy 2)").exists()
    assert ProtocolPhase.everywhere.filter(protocol=shared).count() == len(shared.to_rules())


def test_nobody_copies_another_clinics_protocol_and_a_researcher_none(world):
    birch = build_world("birch")
    before = Protocol.everywhere.count()
    act(world, "protocol", "copy_to_clinic", birch.rows[Protocol].pk)
    shared = Protocol.everywhere.filter(clinic=None).first()
    act(world, "protocol", "copy_to_clinic", shared.pk, Role.RESEARCHER)
    assert Protocol.everywhere.count() == before
