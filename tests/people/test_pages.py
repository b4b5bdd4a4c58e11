"""What people find on the pages: the front page, the admin of each role."""

import re

import pytest
from django.urls import reverse
from django.utils.formats import date_format
from django.utils.html import strip_tags

from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.stations.models import Device, Station
from rehab.stations.tokens import find_device
from tests.support.clock import HERE
from tests.support.world import NOW, build_world, client_of, signed_in

pytestmark = pytest.mark.django_db


def test_the_front_page_says_what_can_be_done(client):
    page = client.get("/").content.decode()
    for words in ("Positive", "Negative", "Binary", "Explicit", "like last time", "Sign in"):
        assert words in page


def test_the_sign_of_life_reaches_the_database(client, django_assert_num_queries):
    with django_assert_num_queries(1):
        assert client.get("/healthz").content == b"ok\n"


def test_pages_allow_no_foreign_script(client):
    policy = client.get("/").headers["Content-Security-Policy"]
    assert "default-src 'self'" in policy
    assert "unsafe" not in policy


def test_a_therapist_reads_date_start_duration_score_type_and_goal(world):
    row = world.pt.get("/admin/rehab/trainingsession/").content.decode()
    found = re.findall(r'<td[^>]* class="field-(\w+)[^"]*"[^>]*>(.*?)</td>', row)
    cells = {name: strip_tags(re.sub(" ?<br>", " / ", cell)) for name, cell in found}
    patient = world.patient
    assert f'href="{reverse("session", args=[world.session.pk])}"' in dict(found)["who"]
    assert cells["who"] == f"{patient.nickname} / {patient.code}"
    assert cells["day"].startswith(f"{date_format(HERE, 'j M Y')} / {HERE:%H:%M}")
    assert cells["duration"] == "10\N{NO-BREAK SPACE}s"
    assert cells["kind"] == "Positive / goal 1.00\N{NO-BREAK SPACE}m"
    assert cells["score"] == "6 points"
    assert cells["hit_rate"] == "67\N{NO-BREAK SPACE}% hits"


def test_a_therapist_cannot_edit_the_log(world):
    client = world.pt
    for name in ("trainingsession", "step", "sessionevent", "sessionmetric"):
        assert client.get(f"/admin/rehab/{name}/add/").status_code == 403
        row = next(row for kind, row in world.rows.items() if kind.__name__.lower() == name)
        url = f"/admin/rehab/{name}/{row.pk}/"
        assert client.get(f"{url}change/").status_code == 200
        assert client.post(f"{url}change/", {"value": 1}).status_code == 403
        assert client.post(f"{url}delete/", {"post": "yes"}).status_code == 403


def test_a_researcher_finds_sessions_by_pseudonym_and_no_other_way(world):
    client = client_of(world, Role.RESEARCHER)
    url = "/admin/rehab/trainingsession/"
    assert world.patient.pseudonym in client.get(url).content.decode()
    detail = client.get(f"{url}{world.session.pk}/change/").content.decode()
    assert world.patient.pseudonym in detail
    assert world.patient.nickname not in detail
    hidden = client.get(url, {"q": world.patient.nickname}).content.decode()
    assert "0 sessions" in hidden
    assert client.get(url, {"patient__nickname__startswith": "zq"}).status_code == 400


def test_a_new_patient_belongs_to_the_therapists_clinic(world):
    form = {"code": "K7-204", "nickname": "Rosa", "paretic_side": "left"}
    form |= {"language": "es", "boards": "own"}
    world.pt.post("/admin/rehab/patient/add/", form)
    assert Patient.everywhere.get(code="K7-204").clinic == world.clinic


def test_a_code_that_is_taken_is_refused_in_words(world):
    form = {"code": world.patient.code, "nickname": "Rosa", "language": "en"}
    page = world.pt.post("/admin/rehab/patient/add/", form)
    assert page.status_code == 200
    assert "already exists" in page.content.decode()


def test_a_new_devices_token_is_shown_once_and_opens_until_revoked(world):
    client = world.lead
    form = {"station": world.rows[Station].pk, "kind": "source", "name": "Treadmill"}
    page = client.post("/admin/rehab/device/add/", form, follow=True).content.decode()
    token = re.search(r'class="token">(\S+?)<', page).group(1)
    device = Device.everywhere.get(name="Treadmill")
    assert find_device(token, NOW) == device
    assert token not in client.get("/admin/rehab/device/").content.decode()
    assert token not in device.token_hash
    client.post("/admin/rehab/device/", {"action": "revoke_tokens", "_selected_action": device.pk})
    assert find_device(token, NOW) is None


def test_a_lead_makes_accounts_of_the_own_clinic_and_never_a_host(world):
    client = world.lead
    form = {
        "username": "new-pt",
        "usable_password": "true",
        "password1": "walk well 2026",
        "password2": "walk well 2026",
        "role": "host",
    }
    page = client.post("/admin/rehab/user/add/", form)
    assert "Select a valid choice" in page.content.decode()
    client.post("/admin/rehab/user/add/", form | {"role": "pt"})
    account = User.everywhere.get(username="new-pt")
    assert (account.clinic, account.role) == (world.clinic, Role.PT)


def test_a_host_makes_clinics_and_their_leads(world):
    client = signed_in(User.everywhere.create_user("host", role=Role.HOST))
    given = {"name": "Oak", "language": "en", "time_zone": "UTC", "log_retention_months": 36}
    client.post("/admin/rehab/clinic/add/", given)
    oak = Clinic.everywhere.get(name="Oak")
    form = {
        "username": "oak-lead",
        "usable_password": "true",
        "password1": "walk well 2026",
        "password2": "walk well 2026",
        "role": "lead",
        "clinic": oak.pk,
    }
    client.post("/admin/rehab/user/add/", form)
    assert User.everywhere.get(username="oak-lead").clinic == oak
    page = client.post("/admin/rehab/user/add/", form | {"username": "x", "clinic": ""})
    assert "every other role needs one" in page.content.decode()


def test_shared_rows_are_the_hosts_to_change(world):
    from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol

    client = world.lead
    for model in (MeasureDefinition, Protocol):
        shared = model.everywhere.filter(clinic=None).first()
        url = f"/admin/rehab/{model._meta.model_name}/{shared.pk}/"
        assert client.get(f"{url}change/").status_code == 200
        assert client.post(f"{url}change/", {"name": "mine"}).status_code == 403
        assert client.post(f"{url}delete/", {"post": "yes"}).status_code == 403


PRIVATE = {
    "patient_id": (
        "start",
        "patient",
        "history",
        "records",
        "consent",
        "take-home",
        "patient-data",
    ),
    "session_id": ("session", "report", "monitor", "scores", "walk"),
}


def test_no_browser_keeps_a_page_with_patients(db):
    """Going back after the sign-out asks the server again."""
    world = build_world("amber")
    pt, keys = world.pt, {"patient_id": world.patient.pk, "session_id": world.session.pk}
    for key, names in PRIVATE.items():
        for name in names:
            url = reverse(name, kwargs={} if name == "start" else {key: keys[key]})
            kept = pt.get(url).headers["Cache-Control"]
            assert "no-store" in kept, name
    for path in ("patients", f"patients/{world.patient.pk}", "sessions", "me"):
        assert pt.get(f"/api/v1/{path}").headers["Cache-Control"] == "private, no-store"
    for name in ("sign-in", "tablet-app", "healthz"):
        assert "private, no-store" not in pt.get(reverse(name)).headers.get("Cache-Control", "")
