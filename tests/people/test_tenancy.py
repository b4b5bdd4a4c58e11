"""Nobody sees another clinic's rows: every model and every route, found by themselves."""

from __future__ import annotations

from pathlib import Path

import pytest
from django.contrib import admin
from django.urls import reverse

from garry_site import urls as site_urls
from rehab.people.audit.audit_log import AuditEntry
from rehab.people.roles import Right, Role, is_hidden_beside, may_see_names, rights_of
from rehab.people.scope import CrossClinicReference, Scope, ScopedManager, UnscopedQuery
from rehab.people.web.admin_base import ScopedOptions
from rehab.stations.models import Device, Station
from tests.support.foreign_writes import find_foreign_writes
from tests.support.tenancy import (
    find_leaks,
    find_offers,
    may_read,
    some_actors,
    undeclared_views,
)
from tests.support.world import (
    all_actors,
    scoped_models,
)

pytestmark = pytest.mark.django_db


# --- models -------------------------------------------------------------------------------------


def test_every_model_says_how_it_belongs_to_a_clinic(worlds):
    for model in scoped_models():
        assert isinstance(getattr(model, "scope", None), Scope), f"{model} has no scope"
        assert isinstance(model.objects, ScopedManager), f"{model}.objects is not scoped"
        for world in worlds:
            assert model in world.rows, f"tests/support/world.py makes no {model.__name__}"


@pytest.mark.parametrize("model", scoped_models(), ids=lambda model: model.__name__)
def test_objects_gives_nothing_before_it_is_told_for_whom(model):
    objects = model.objects
    for query in (objects.all, objects.filter, objects.count, objects.create, objects.first):
        with pytest.raises(UnscopedQuery, match="visible_to"):
            query()


def test_every_actor_sees_rows_of_the_own_clinic_only(worlds):
    for actor in all_actors(*worlds):
        for model in scoped_models():
            seen = set(model.objects.visible_to(actor.subject).values_list("pk", flat=True))
            for world in worlds:
                row = world.rows[model]
                if actor.role == "device":
                    station_side = {
                        "Station",
                        "TrainingSession",
                        "Step",
                        "SessionEvent",
                        "SessionMetric",
                        "QuestionnaireResponse",
                    }
                    expected = actor.clinic == world.name and model.__name__ in station_side
                else:
                    expected = may_read(actor, model, world.name) and Right.VIEW in rights_of(
                        actor.role, model.__name__
                    )
                assert (row.pk in seen) == expected, (
                    f"{actor.label}, {model.__name__}, {world.name}"
                )


@pytest.mark.parametrize("nobody", [None, object(), "pt", 1])
def test_what_is_no_actor_sees_nothing(nobody, worlds):
    assert not any(model.objects.visible_to(nobody).exists() for model in scoped_models())


def test_a_device_sees_its_own_station_only_and_nothing_once_revoked(worlds):
    amber, _ = worlds
    other = Station.everywhere.create(clinic=amber.clinic, name="other")
    neighbor = Device(clinic=amber.clinic, station=other, kind="tablet", name="n", token_hash="n")
    neighbor.save()
    assert not type(amber.session).objects.visible_to(neighbor).exists()
    assert type(amber.session).objects.visible_to(amber.device).exists()
    amber.device.revoked_at = amber.device.created_at
    assert not type(amber.session).objects.visible_to(amber.device).exists()


def test_rows_of_two_clinics_are_never_tied_together(worlds):
    amber, birch = worlds
    stray = Device(
        clinic=amber.clinic, station=birch.rows[Station], kind="robot", name="x", token_hash="x"
    )
    with pytest.raises(CrossClinicReference, match="same clinic"):
        stray.save()
    amber.session.patient = birch.patient
    with pytest.raises(CrossClinicReference):
        amber.session.save()


def test_the_audit_log_names_no_patient_of_another_clinic(worlds):
    """A form that is sent for one is answered like that of nobody, and noted."""
    amber, birch = worlds
    lead = amber.lead
    form = reverse("admin:rehab_patient_change", args=[birch.patient.pk])
    assert lead.post(form).status_code == 302
    assert AuditEntry.everywhere.filter(clinic=amber.clinic, about=form).exists()
    assert not AuditEntry.everywhere.filter(clinic=amber.clinic, patient=birch.patient).exists()
    log = lead.get(reverse("admin:rehab_auditentry_changelist")).content.decode()
    assert f'class="field-page"><span title="{form}">Patients</span></td>' in log
    assert birch.patient.nickname not in log


# --- routes -------------------------------------------------------------------------------------


WHO = ["stranger", "pt of amber"]
WHO_ELSE = ["host", "switched off", "pt of birch", "lead of amber", "lead of birch"]
WHO_ELSE += [
    f"{role} of {clinic}"
    for role in ("researcher", "sponsor", "device")
    for clinic in ("amber", "birch")
]


def test_the_matrix_has_everybody(worlds):
    assert {*WHO, *WHO_ELSE} == {actor.label for actor in all_actors(*worlds)}


@pytest.mark.wide
@pytest.mark.parametrize(
    "who", [*WHO, *(pytest.param(who, marks=pytest.mark.long) for who in WHO_ELSE)]
)
def test_no_route_shows_a_clinic_to_others(worlds, who):
    leaks, counts = find_leaks(worlds, some_actors(worlds, who))
    assert leaks == []
    assert counts[who] > 100  # the matrix is not empty


@pytest.mark.wide
@pytest.mark.parametrize(
    "who",
    [
        "pt of amber",
        *(
            pytest.param(f"{role} of amber", marks=pytest.mark.long)
            for role in ("lead", "researcher", "sponsor", "device")
        ),
    ],
)
def test_no_form_changes_rows_of_another_clinic(worlds, who):
    (actor,) = some_actors(worlds, who)
    leaks, count = find_foreign_writes(worlds, actor)
    assert leaks == []
    assert count > 100


def test_every_view_says_who_may_open_it():
    assert undeclared_views() == []


def test_every_admin_page_is_scoped():
    for model, options in admin.site._registry.items():
        assert isinstance(options, ScopedOptions), model
        for inline in options.inlines:
            assert issubclass(inline, ScopedOptions), inline


def test_every_form_offers_rows_of_the_own_clinic_only(worlds):
    leaks, checked = find_offers(worlds, all_actors(*worlds))
    assert leaks == []
    assert checked


def test_pages_and_admin_never_ask_for_rows_of_everywhere():
    """`everywhere` is for the server's own work; code that answers people goes by `visible_to`."""
    root = Path(site_urls.__file__).resolve().parent.parent / "rehab"
    named = ("*admin*", "api*", "schemas", "consumers/*", "forms")
    answering = [file for name in named for file in root.rglob(f"{name}.py")]
    answering += root.rglob("views/*.py")
    assert len(answering) > 10
    for file in answering:
        assert "everywhere" not in file.read_text(), file


@pytest.mark.parametrize("role", Role)
def test_only_a_researcher_does_not_see_persons_beside_rows(role):
    hidden = {name for name in ("Patient", "User", "Station") if is_hidden_beside(role, name)}
    assert hidden == (set() if may_see_names(role) else {"Patient", "User"})
