"""The host's buttons: a clinic is written into a file, verified and removed by a receipt."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path
from typing import Any

import pytest
from django.core.management import call_command
from django.test import Client
from django.urls import reverse

from rehab.exports.clinic import clinic_removal, job
from rehab.exports.clinic.clinic_removal import make_receipt
from rehab.exports.clinic.job import Job
from rehab.exports.clinic.sealed_file import inspect
from rehab.exports.encryption import generate_key, read_identities
from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.people.sign_in.step_up import CONFIRMED_AT, LIFETIME
from rehab.sessions.live.database import clinic_owners
from rehab.sessions.models import TrainingSession
from tests.support.accounts import PASSWORD
from tests.support.archives import body_of
from tests.support.servers import run_python
from tests.support.walks import HIT, walk
from tests.support.world import World, build_world, signed_in

pytestmark = pytest.mark.django_db(transaction=True)

SECRET, PUBLIC = generate_key()
NOBODY = 2**22 + 1  # no process has this id
SEEDED = 'from tests.support.world import build_world\nbuild_world("amber")'


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch, settings: Any, tmp_path: Path) -> None:
    """Run subcommands in this process, to their end."""

    def run(command: list[str], output: Any) -> int:
        with open(output.fileno(), "w", closefd=False) as out:
            try:
                call_command(*command[3:], stdout=out, stderr=out)
            except Exception as problem:
                out.write(str(problem))
        return NOBODY

    settings.DATA_DIR = tmp_path
    settings.MOVE_KEYS = [PUBLIC]
    monkeypatch.setattr(job, "run_aside", run)
    monkeypatch.setattr("os.nice", lambda _by: None)
    monkeypatch.setattr("rehab.management.commands.clinic.LEAVES_WITHIN_S", 0.0)
    monkeypatch.setattr(clinic_removal, "REST", 0.0)


@pytest.fixture
def amber() -> World:
    world = build_world("amber")
    walk(world.patient, "positive", [HIT] * 5)
    return world


@pytest.fixture
def host() -> Client:
    return signed_in(User.everywhere.create_superuser("root", password=PASSWORD))


def page_of(clinic: Clinic) -> str:
    return reverse("move-clinic", args=[clinic.pk])


def press(client: Client, clinic: Clinic, part: str, **form: str) -> str:
    """Press a button; return the page that one is led to."""
    answer = client.post(page_of(clinic), {"part": part} | form, follow=True)
    return str(answer.content.decode())


def receipt_of(file: Path) -> str:
    """Return what an installation says that took the file in."""
    with file.open("rb") as source:
        return make_receipt(inspect(source, read_identities(SECRET)).digests)


def test_written_fetched_taken_in_elsewhere_and_removed(amber, host, tmp_path, capsys):
    clinic = amber.clinic
    said = press(host, clinic, "export", keys=PUBLIC, tokens="on")
    assert f"{clinic}: 1 patients" in said
    assert "Download" in said
    file = tmp_path / "fetched.age"
    file.write_bytes(body_of(host.get(reverse("clinic-file", args=[clinic.pk]))))
    assert f"{clinic} is as it was sealed" in press(host, clinic, "verify")
    key = tmp_path / "key.txt"
    key.write_text(SECRET)
    receipt = receipt_of(file)
    assert "is not as the receipt says" in press(host, clinic, "remove", receipt="0" * 64)
    said = press(host, clinic, "remove", receipt=receipt)
    assert f"{clinic} is gone" in said
    assert not Clinic.everywhere.filter(pk=clinic.pk).exists()
    paper = json.loads(body_of(host.get(reverse("clinic-gone", args=[clinic.pk]))))
    assert (paper["clinic"], paper["by"]) == (clinic.name, "root")
    assert paper["left_with_receipt"] == receipt
    assert AuditEntry.everywhere.filter(act=Act.CLINIC_OUT, about__contains="root").exists()
    call_command("clinic", "import", str(file), "--key", str(key))
    assert f"where it was: {receipt}" in capsys.readouterr().out
    there = Clinic.everywhere.get(name=clinic.name)
    assert receipt in host.get(page_of(there)).content.decode()


def test_a_host_cannot_choose_who_opens_the_file(amber, host):
    """Only the server's settings do: who signs in as a host sees no patient."""
    _, own = generate_key()
    assert "GARRY_MOVE_KEYS" in press(host, amber.clinic, "export", keys=f"{PUBLIC} {own}")
    assert not Job(amber.clinic.pk).file.exists()


def test_what_was_changed_since_the_export_or_runs_stays(amber, host, tmp_path):
    clinic = amber.clinic
    press(host, clinic, "export", keys=PUBLIC)
    receipt = receipt_of(Job(clinic.pk).file)
    session = amber.begin_session()
    TrainingSession.everywhere.filter(pk=session.pk).update(state="running")
    assert "End or pause them" in press(host, clinic, "remove", receipt=receipt)
    TrainingSession.everywhere.filter(pk=session.pk).update(state="paused")
    assert "was changed since the export" in press(host, clinic, "remove", receipt=receipt)
    assert Patient.everywhere.filter(clinic=clinic).count() == 1
    assert User.everywhere.filter(clinic=clinic, is_active=True).exists()
    assert not Job(clinic.pk).certificate.exists()


def test_nothing_begins_while_one_runs_or_by_a_wrong_form(amber, host, monkeypatch):
    clinic = amber.clinic
    assert "begins with age1" in press(host, clinic, "export", keys="age1nonsense")
    assert 'class="errorlist"' in press(host, clinic, "remove", receipt="xyz")
    assert not Job(clinic.pk).folder.exists()
    press(host, clinic, "verify")
    monkeypatch.setattr(clinic_owners, "is_alive", lambda _owner: True)
    answer = host.post(page_of(clinic), {"part": "export", "keys": PUBLIC})
    assert answer["Refresh"]
    assert "<form" not in re.sub(r"(?s).*<main", "", answer.content.decode()).split("</main")[0]
    assert not Job(clinic.pk).file.exists()


def test_each_act_is_recorded_and_others_have_no_buttons(amber, host):
    clinic = amber.clinic
    press(host, clinic, "export", keys=PUBLIC)
    host.get(reverse("clinic-file", args=[clinic.pk]))
    told = AuditEntry.everywhere.filter(act=Act.EXPORT, by__username="root", clinic=clinic)
    assert set(told.values_list("about", flat=True)) == {
        f"{page_of(clinic)}: export",
        reverse("clinic-file", args=[clinic.pk]),
    }
    change = reverse("admin:rehab_clinic_change", args=[clinic.pk])
    assert page_of(clinic) in host.get(change).content.decode()
    lead = signed_in(amber.people[Role.LEAD])
    assert page_of(clinic) not in lead.get(change).content.decode()
    for name in ("move-clinic", "clinic-file", "clinic-gone"):
        assert lead.get(reverse(name, args=[clinic.pk])).status_code == 403
    assert host.get(reverse("move-clinic", args=[10**6])).status_code == 404
    store = host.session
    store[CONFIRMED_AT] -= LIFETIME.total_seconds()
    store.save()
    for name in ("move-clinic", "clinic-file", "clinic-gone"):
        answer = host.get(reverse(name, args=[clinic.pk]))
        assert answer["Location"].startswith(reverse("confirm"))


@pytest.mark.server
def test_it_runs_as_a_process_of_its_own(tmp_path, monkeypatch):
    monkeypatch.undo()
    run_python(tmp_path, "manage.py", "migrate", "-v0")
    run_python(tmp_path, "manage.py", "shell", "-v0", "-c", SEEDED)
    monkeypatch.setenv("GARRY_DATA_DIR", str(tmp_path))
    monkeypatch.setattr("django.conf.settings.DATA_DIR", tmp_path)
    one = Job(1)
    one.start("verify", "--", "zqamberclinicqz")
    assert one.is_running
    until_s = time.monotonic() + 60
    while one.is_running and time.monotonic() < until_s:
        time.sleep(0.2)
    assert "is as it was sealed: 1 patients" in one.said
