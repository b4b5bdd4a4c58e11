"""A clinic taken out, in, compared and removed: every row of every model, sealed all the way."""

from __future__ import annotations

import errno
import hashlib
import io
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from django.core.management import CommandError, call_command
from django.urls import reverse
from django.utils import timezone

from rehab.exports.clinic import clinic_import, clinic_removal
from rehab.exports.clinic.clinic_models import STAYS, clinic_paths, moving_models, moving_tables
from rehab.exports.clinic.row_serialization import ClinicRows
from rehab.exports.clinic.sealed_file import seal_everything
from rehab.exports.encryption import generate_key
from rehab.patients.erasure import erase
from rehab.people.audit import append_only_triggers, seals
from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.audit.moves import ClinicMove
from rehab.people.models import Clinic, ErasureReason, Patient, User
from rehab.people.roles import Role
from rehab.people.server_keys import Purpose, decrypt_text, encrypt_text
from rehab.people.sign_in.factors.factors import Authenticator
from rehab.people.sign_in.tokens import find_by_token
from rehab.sessions import seals as session_seals
from rehab.sessions.log import Step
from rehab.sessions.log_fold import check_log
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.stations.models import Device
from rehab.studies.participants import Enrollment
from tests.support.archives import body_of, open_archive, rows_of
from tests.support.walks import HIT, MISS, walk
from tests.support.world import NOW, World, build_world, scoped_models, set_owner, signed_in

pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.postgres]

SECRET, PUBLIC = generate_key()


@pytest.fixture(autouse=True)
def short_wait(monkeypatch: pytest.MonkeyPatch, settings: Any) -> None:
    monkeypatch.setattr("rehab.management.commands.clinic.LEAVES_WITHIN_S", 0.0)
    monkeypatch.setattr(clinic_removal, "REST", 0.0)
    monkeypatch.setattr(os, "nice", lambda _by: None)
    settings.BACKUP_KEYS = [PUBLIC]


@pytest.fixture
def key(tmp_path: Path) -> Path:
    path = tmp_path / "key.txt"
    path.write_text(SECRET)
    return path


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "amber.clinic"


@pytest.fixture
def world() -> World:
    """A clinic with a row of every model, walked with measure and protocol of all clinics too."""
    world = build_world("amber")
    Authenticator.everywhere.update(credential=encrypt_text(Purpose.AUTHENTICATORS, "JBSWY3DP"))
    walk(world.patient, "positive", [HIT, MISS, None] * 5)
    world.clinic.refresh_from_db()
    return world


def run(part: str, *args: Any) -> str:
    out = io.StringIO()
    call_command("clinic", part, *map(str, args), stdout=out, stderr=out)
    return out.getvalue()


def move(world: World, file: Path, key: Path, *options: str) -> Clinic:
    """Take a clinic out and away, and in again under new keys; return it."""
    name = world.clinic.name
    run("export", name, file, *options)
    run("remove", name, file.with_suffix(".json"), "--file", file, "--key", key)
    build_world("birch")  # takes the next keys
    run("import", file, "--key", key)
    return Clinic.everywhere.get(name=name)


def find_broken(clinic: Clinic) -> list[str]:
    logs = [line for log in seals.sealed_models() for line in seals.find_broken_of(log, clinic.pk)]
    return logs + list(session_seals.find_broken_of(clinic.pk))


def test_every_model_of_a_clinic_moves_or_says_why_not():
    there = {model._meta.label_lower for model in clinic_paths()}
    moving = {model._meta.label_lower for model in moving_models()}
    assert {model._meta.label_lower for model in scoped_models()} <= there
    assert moving | STAYS.keys() == there
    assert not moving & STAYS.keys()


def test_all_rows_move_and_nothing_else_changes(world, file, key):
    other = build_world("cedar")
    seal_everything(world.clinic, NOW)
    rows = ClinicRows(world.clinic.pk)
    before, others = rows.digest(), ClinicRows(other.clinic.pk).digest()
    counts = rows.count()
    assert all(counts.values()), [label for label, count in counts.items() if not count]
    clinic = move(world, file, key)
    assert clinic.pk != world.clinic.pk
    moved = ClinicRows(clinic.pk, move=ClinicMove.everywhere.get(clinic=clinic, number=2))
    after = moved.digest()
    grown = {"rehab.auditentry", "rehab.logseal"}  # by the export itself
    assert {label for label in before if before[label] != after[label]} <= grown
    assert ClinicRows(other.clinic.pk).digest() == others
    assert find_broken(clinic) == []
    said = run("verify", clinic.name, "--file", file, "--key", key)
    assert f"{clinic} is as {file} has it." in said
    assert f"{clinic} is as it was sealed: " in said
    assert f"steps and events: {session_seals.last_seal(clinic.pk).digest}" in said
    for session in TrainingSession.everywhere.filter(clinic=clinic):
        check_log(session)
    shared = MeasureDefinition.everywhere.filter(clinic=None)
    assert shared.filter(sessions__clinic=clinic).exists()


def test_seals_hold_over_several_moves_and_find_what_was_changed(world, file, key):
    first = move(world, file, key)
    walk(Patient.everywhere.get(clinic=first), "negative", [HIT] * 3)
    name, again = first.name, file.with_name("2.clinic")
    run("export", name, again)
    run("remove", name, again.with_suffix(".json"), "--file", again, "--key", key)
    run("import", again, "--key", key)
    clinic = Clinic.everywhere.get(name=name)
    assert ClinicMove.everywhere.filter(clinic=clinic).count() == 3  # with that of the world
    assert find_broken(clinic) == []
    with append_only_triggers.lifted("default"):
        step = Step.everywhere.filter(session__clinic=clinic).first()
        Step.everywhere.filter(pk=step.pk).update(value=9.0)
    assert len(find_broken(clinic)) == 1
    with pytest.raises(CommandError, match="not as they were sealed"):
        run("verify", name)


def test_people_devices_and_keys_after_a_move(world, file, key):
    codes = list(Enrollment.everywhere.values_list("code", "allocation__group"))
    world.people[Role.LEAD].set_password("correct horse battery")
    world.people[Role.LEAD].save()
    clinic = move(world, file, key)
    lead = User.everywhere.get(username=world.people[Role.LEAD].username)
    assert lead.clinic == clinic
    assert lead.is_active
    assert lead.check_password("correct horse battery")
    assert find_by_token(Device, world.token, NOW) is None
    app = Authenticator.everywhere.get(user__clinic=clinic)
    assert decrypt_text(Purpose.AUTHENTICATORS, app.credential) == "JBSWY3DP"
    mine = Enrollment.everywhere.filter(clinic=clinic)
    assert list(mine.values_list("code", "allocation__group")) == codes
    entry = AuditEntry.everywhere.get(clinic=clinic, act=Act.CLINIC_IN)
    assert entry.through == "server console"


def test_tokens_move_if_that_is_asked(world, file, key):
    clinic = move(world, file, key, "--tokens")
    device = find_by_token(Device, world.token, NOW)
    assert device is not None
    assert device.clinic == clinic


def test_a_persons_requests_after_a_move(world, file, key):
    clinic = move(world, file, key)
    patient = Patient.everywhere.get(clinic=clinic, code=world.patient.code)
    lead = signed_in(User.everywhere.get(username=world.people[Role.LEAD].username))
    answer = lead.get(reverse("patient-data", kwargs={"patient_id": patient.pk}))
    files = open_archive(body_of(answer))
    walked = Step.everywhere.filter(session__patient=patient)
    assert len(rows_of(files["steps.csv"])) == walked.count()
    erase(patient, ErasureReason.ASKED, None, timezone.now())
    assert Patient.everywhere.get(pk=patient.pk).nickname != world.patient.nickname
    assert find_broken(clinic) == []


def test_names_that_are_taken(world, file, key):
    run("export", world.clinic.name, file)
    run("remove", world.clinic.name, file.with_suffix(".json"), "--file", file, "--key", key)
    other = build_world("birch").clinic
    lead = world.people[Role.LEAD].username
    User.everywhere.create_user(lead, role=Role.PT, clinic=other)
    other.name = world.clinic.name
    other.save()
    with pytest.raises(CommandError, match="another name by --name"):
        run("import", file, "--key", key)
    told = run("import", file, "--key", key, "--name", "Amber again")
    assert f"The account {lead} is {lead}.2 here" in told
    clinic = Clinic.everywhere.get(name="Amber again")
    assert User.everywhere.get(username=f"{lead}.2").clinic == clinic
    assert User.everywhere.get(username=lead).clinic == other
    run("verify", "Amber again", "--file", file, "--key", key)


def test_hosts_who_acted_go_along_without_any_right(world, file, key):
    host = User.everywhere.create_superuser("root", password="correct horse battery")
    AuditEntry(clinic=world.clinic, by=host, act=Act.UNLOCK, at=NOW).save()
    clinic = move(world, file, key)
    stub = AuditEntry.everywhere.get(clinic=clinic, act=Act.UNLOCK).by
    assert (stub.username, stub.clinic, stub.is_active) == ("root.2", clinic, False)
    assert not stub.has_usable_password()
    assert User.everywhere.get(username="root").role == Role.HOST
    assert find_broken(clinic) == []


def test_measures_and_protocols_of_all_clinics_are_found_or_copied(world, file, key):
    MeasureDefinition.everywhere.filter(clinic=None).update(unit="lb")  # another one there
    run("export", world.clinic.name, file)
    run("remove", world.clinic.name, file.with_suffix(".json"), "--file", file, "--key", key)
    MeasureDefinition.everywhere.filter(clinic=None).update(unit="W/kg")
    run("import", file, "--key", key)
    clinic = Clinic.everywhere.get(name=world.clinic.name)
    assert {one.unit for one in MeasureDefinition.everywhere.filter(clinic=clinic)} == {"m", "lb"}
    assert Protocol.everywhere.filter(clinic=clinic).count() == 1
    run("verify", clinic.name, "--file", file, "--key", key)


# --- refusals -------------------------------------------------------------------------------------


def cut(content: bytes) -> bytes:
    return content[: len(content) * 2 // 3]


def damage(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (cut, "damaged or was cut off. Take another copy"),
        (damage, "damaged or was cut off. Take another copy"),
        (lambda _: b"", "no backup of GARRY. Choose another file"),
    ],
)
def test_a_spoiled_file_is_refused_before_anything_is_stored(
    world, file, key, spoil: Callable[[bytes], bytes], said
):
    run("export", world.clinic.name, file)
    file.write_bytes(spoil(file.read_bytes()))
    with pytest.raises(CommandError, match=said):
        run("import", file, "--key", key, "--name", "Another")
    assert Clinic.everywhere.count() == 1


@pytest.mark.parametrize(
    ("label", "column", "value", "said"),
    [
        ("rehab.user", "clinic_id", None, "not of its clinic"),  # it would be a host's
        ("rehab.user", "is_superuser", True, "not of its clinic"),
        ("rehab.patient", "clinic_id", 7, "not of its clinic"),
        ("rehab.trainingsession", "patient_id", -3, "a key beyond its own"),
        ("rehab.step", "session_id", 10**12, "a key beyond its own"),
    ],
)
def test_a_forged_row_reaches_no_other_clinic(
    world, file, key, monkeypatch, label, column, value, said
):
    read = ClinicRows.read

    def forge(rows: ClinicRows, table: Any) -> Any:
        for row in read(rows, table):
            if table.label == label:
                row[table.index(column)] = value
            yield row

    with monkeypatch.context() as patched:
        patched.setattr(ClinicRows, "read", forge)
        run("export", world.clinic.name, file)
    run("remove", world.clinic.name, file.with_suffix(".json"), "--destroy")
    before = {model: model._base_manager.count() for model in moving_models()}
    with pytest.raises(CommandError, match=said):
        run("import", file, "--key", key)
    assert {model: model._base_manager.count() for model in moving_models()} == before


def test_another_key(world, file, tmp_path):
    run("export", world.clinic.name, file)
    wrong = tmp_path / "wrong.txt"
    wrong.write_text(generate_key()[0])
    with pytest.raises(CommandError, match="Take the secret key that belongs to it"):
        run("import", file, "--key", wrong)


def test_a_backup_is_no_clinic(world, file, key):
    call_command("backup", file, stdout=io.StringIO())
    with pytest.raises(CommandError, match=r"read by `\S+ manage\.py restore`"):
        run("import", file, "--key", key)


def test_another_version(world, file, key, monkeypatch):
    run("export", world.clinic.name, file)
    monkeypatch.setattr("rehab.exports.clinic.sealed_file.tables_version", lambda: [["rehab", "9"]])
    with pytest.raises(CommandError, match="Bring both installations to the same version"):
        run("import", file, "--key", key)


def test_an_import_twice(world, file, key):
    run("export", world.clinic.name, file)
    with pytest.raises(CommandError, match="Patients of the file are here already"):
        run("import", file, "--key", key, "--name", "Amber again")  # it has never left
    run("remove", world.clinic.name, file.with_suffix(".json"), "--file", file, "--key", key)
    run("import", file, "--key", key)
    with pytest.raises(CommandError, match="This file was taken in on"):
        run("import", file, "--key", key, "--name", "Amber again")


@pytest.mark.parametrize("part", ["export", "remove"])
def test_running_sessions_are_refused(world, file, key, part):
    run("export", world.clinic.name, file)
    session = world.begin_session()
    TrainingSession.everywhere.filter(pk=session.pk).update(state="running")
    args = (file,) if part == "export" else (file.with_suffix(".json"), "--destroy")
    with pytest.raises(CommandError, match=rf"sessions run \({session.pk}\). End or pause them"):
        run(part, world.clinic.name, *args)


def test_a_failed_import_leaves_nothing_and_can_be_repeated(world, file, key, monkeypatch):
    run("export", world.clinic.name, file)
    run("remove", world.clinic.name, file.with_suffix(".json"), "--file", file, "--key", key)
    empty = {model: model._base_manager.count() for model in moving_models()}
    with monkeypatch.context() as patched:
        patched.setattr(clinic_import.Arrival, "_open", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            run("import", file, "--key", key)
        assert {model: model._base_manager.count() for model in moving_models()} == empty
        # Killed on the way: what it left is removed by the next try.
        patched.setattr(clinic_import, "delete_rows", lambda _key: None)
        with pytest.raises(ZeroDivisionError):
            run("import", file, "--key", key)
    assert not User.everywhere.filter(clinic__isnull=False, is_active=True).exists()
    set_owner(Clinic.everywhere.get().pk, "gone|1|1")
    run("import", file, "--key", key)
    assert Clinic.everywhere.count() == 1


# --- removal --------------------------------------------------------------------------------------


def test_a_removed_clinic_leaves_a_certificate_and_nothing_else(world, file, key):
    other = build_world("birch")
    others = ClinicRows(other.clinic.pk).digest()
    name, pk = world.clinic.name, world.clinic.pk
    counts = ClinicRows(pk).count()
    run("export", name, file)
    paper = file.with_suffix(".json")
    told = run("remove", name, paper, "--file", file, "--key", key)
    for model, path in clinic_paths().items():
        assert not model._base_manager.filter(**{path: pk}).exists(), model
    assert ClinicRows(other.clinic.pk).digest() == others
    gone = json.loads(paper.read_text())
    assert gone["clinic"] == name
    assert gone["by"].endswith(", server console")
    assert gone["rows"]["rehab.step"] == counts["rehab.step"] == gone["deleted"]["rehab.step"]
    assert gone["digests_of_rows"].keys() == {table.label for table in moving_tables()}
    assert gone["last_seals"]["steps and events"]
    digest = hashlib.sha256(paper.read_bytes()).hexdigest()
    entry = AuditEntry.everywhere.get(clinic=None, act=Act.CLINIC_OUT)
    assert digest in entry.about
    assert digest in told


@pytest.mark.parametrize("at", ["the end", "half way"])
def test_a_removal_that_stops_keeps_its_certificate_and_is_completed(
    world, file, key, monkeypatch, at
):
    """A full disk, or a killed process: what is gone stands in a pending certificate."""
    name, pk, paper = world.clinic.name, world.clinic.pk, file.with_suffix(".json")
    run("export", name, file)
    steps = ClinicRows(pk).count()["rehab.step"]
    given = ("remove", name, paper, "--file", file, "--key", key)
    with monkeypatch.context() as patched:
        if at == "the end":
            patched.setattr(clinic_removal, "REMOVED", "\ud800")  # cannot be written
        else:
            patched.setattr(clinic_removal, "_hand_accounts_on", lambda _: 1 / 0)
        with pytest.raises((UnicodeEncodeError, ZeroDivisionError)):
            run(*given)
    pending = json.loads(paper.read_text())
    assert pending["certificate"] == clinic_removal.PENDING
    assert pending["rows"]["rehab.step"] == steps
    run(*given)
    gone = json.loads(paper.read_text())
    assert not Clinic.everywhere.filter(pk=pk).exists()
    assert (gone["certificate"], gone["rows"]) == (clinic_removal.REMOVED, pending["rows"])
    assert gone["digests_of_rows"] == pending["digests_of_rows"]
    entries = AuditEntry.everywhere.filter(clinic=None, act=Act.CLINIC_OUT)
    assert hashlib.sha256(paper.read_bytes()).hexdigest() in entries.last().about
    with pytest.raises(CommandError, match="There is no clinic|is there already"):
        run(*given)


def test_a_full_disk_at_the_end_of_a_removal_is_told_with_the_cure(world, file, monkeypatch):
    paper, replace, times = file.with_suffix(".json"), Path.replace, iter([True])

    def once(self: Path, target: Path) -> Path:
        if next(times, False):
            return replace(self, target)
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", once)
        with pytest.raises(CommandError, match=r"is gone, but .* pending.*No space.*Make room"):
            run("remove", world.clinic.name, paper, "--destroy")
    assert json.loads(paper.read_text())["rows"]["rehab.step"]
    run("remove", world.clinic.name, paper, "--destroy")
    assert json.loads(paper.read_text())["certificate"] == clinic_removal.REMOVED


def test_what_was_added_since_the_file_is_not_lost(world, file, key):
    run("export", world.clinic.name, file)
    world.add_patient("Later")
    paper = file.with_suffix(".json")
    with pytest.raises(CommandError, match=r"not as the file has it \(.*patient.*Export it again"):
        run("remove", world.clinic.name, paper, "--file", file, "--key", key)
    assert Patient.everywhere.filter(nickname="Later").exists()
    assert User.everywhere.get(pk=world.people[Role.LEAD].pk).is_active  # and nobody is shut out
    with pytest.raises(CommandError, match="Name the file that it leaves with"):
        run("remove", world.clinic.name, paper)
    run("remove", world.clinic.name, paper, "--destroy")
    assert not Patient.everywhere.exists()


def test_a_server_that_has_the_clinic_is_waited_for(world, file, key):
    set_owner(world.clinic.pk, f"{os.uname().nodename}|1|{_started(1)}")
    with pytest.raises(CommandError, match="A server still has"):
        run("remove", world.clinic.name, file.with_suffix(".json"), "--destroy")
    assert Clinic.everywhere.filter(pk=world.clinic.pk).exists()
    assert find_by_token(Device, world.token, NOW) is not None


def _started(pid: int) -> str:
    from rehab.sessions.live.database import clinic_owners

    return clinic_owners._start_time(pid)
