"""What the page that takes recordings does not take."""

from __future__ import annotations

import shutil
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from typing import Any
from urllib.parse import urlencode

import pytest
from django.db import connection
from django.urls import reverse

from rehab.people.roles import Role
from rehab.sessions.setup import recordings
from rehab.sessions.setup.recordings import (
    UploadRefused,
    add_part,
    check_upload,
    discard_old_uploads,
    name_recording,
    uploaded_file,
    write_columns,
)
from rehab.sources.recording.signals import measure_file
from tests.support import samples
from tests.support.data import signals
from tests.support.world import client_of


@pytest.fixture(autouse=True)
def folder(settings, tmp_path):
    settings.DATA_DIR = tmp_path
    return tmp_path


def test_parts_follow_each_other():
    file = uploaded_file(7, ".csv")
    add_part(file, b"abc", 0)
    for at in (0 + 1, 4, -1):
        with pytest.raises(UploadRefused):
            add_part(file, b"x", at)
    add_part(file, b"def", 3)
    assert file.read_bytes() == b"abcdef"


def test_another_upload_replaces_the_one_before_of_this_person_only():
    mine, theirs = uploaded_file(7, ".csv"), uploaded_file(8, ".csv")
    add_part(mine, b"mine", 0)
    add_part(theirs, b"theirs", 0)
    other = uploaded_file(7, ".c3d")
    add_part(other, b"new", 0)
    assert not mine.exists()
    assert (other.read_bytes(), theirs.read_bytes()) == (b"new", b"theirs")


def test_files_of_one_walk_are_stored_side_by_side():
    forces, moments = uploaded_file(7, ".mot", 0), uploaded_file(7, ".mot", 1)
    add_part(forces, b"forces", 0)
    add_part(moments, b"moments", 0)
    assert forces.read_bytes() == b"forces"
    add_part(forces, b"another walk", 0)
    assert not moments.exists()
    with pytest.raises(UploadRefused):
        uploaded_file(7, ".mot", recordings.FILES_MAX)


@pytest.mark.parametrize("at", [0, 5])
def test_no_part_is_written_through_a_link(tmp_path, at):
    secret = tmp_path / "secret_key"
    secret.write_bytes(b"12345")
    file = uploaded_file(7, ".csv")
    file.symlink_to(secret)
    try:
        add_part(file, b"mine", at)
    except UploadRefused:
        assert at
    assert secret.read_bytes() == b"12345"


def upload(client, files):
    """Send files as the page does, in parts; return what it then sends as their endings."""
    for place, file in enumerate(files):
        data = file.read_bytes()
        for at in range(0, len(data), recordings.PART_BYTES):
            query = urlencode({"at": at, "ending": file.suffix, "file": place})
            part = data[at : at + recordings.PART_BYTES]
            address = f"{reverse('add-recording-part')}?{query}"
            answer = client.post(address, part, content_type="application/octet-stream")
            assert answer.status_code == 200
    return ",".join(file.suffix for file in files)


@pytest.mark.django_db
@pytest.mark.parametrize(("is_confirmed", "replayed"), [(True, 3), (False, 1)])
def test_an_upload_is_stored_with_whether_it_is_overground(
    world, monkeypatch, folder, is_confirmed, replayed
):
    """What the person at the page confirms decides, and goes with the recording."""
    pytest.importorskip("ezc3d")
    monkeypatch.setattr(recordings, "close_old_connections", lambda: None)  # it is the test's
    client = client_of(world, Role.PT)
    endings = upload(client, [signals("lab_files") / "btk_pig_motion3_ff.c3d"])
    page = client.post(reverse("check-recording"), {"ending": endings, "mass": ""})
    found = page.context["found"]
    assert found["is_overground"]
    answers = {
        f"{one['side']}.{one['channel']}.{part}": one[part]
        for one in found["channels"]
        for part in ("column", "factor")
    }
    answers |= {f"time.{part}": found["time"][part] for part in ("column", "factor")}
    answers |= {"ending": endings, "mass": "", "name": "floor", "confirm": "yes"}
    page = client.post(
        reverse("check-recording"), answers | ({"overground": "on"} if is_confirmed else {})
    )
    assert page.context["stored"] == "floor.csv"
    assert ("--overground" in page.content.decode()) == is_confirmed
    stored = folder / "recordings" / "floor.csv"
    names = stored.read_text().splitlines()[0].split(",")
    assert {"left_forward_n", "left_hip_up_m", "right_knee_angle_rad"} < set(names)
    strides, _ = measure_file(stored, None, 74.0, None, 0.05, None, is_overground=False)
    assert sum(not stride.reasons for stride in strides) == replayed


@pytest.mark.django_db
@pytest.mark.parametrize(
    ("names", "mass", "shown"),
    [
        (["gaitalytics_treadmill_events.c3d"], "", "RAnkleMoment.X"),
        (["btk_pig_flatfoot_full.c3d"], "", "LAnkleMoment.X"),
        (["btk_pig_motion3_ff.c3d"], "", "LAnkleMoment.X"),
        (["g23_grf.mot", "g23_id.sto", "g23_ik.mot"], "72.6", "ankle_angle_r_moment"),
        (["g23_grf.mot"], "", "The body mass is not in this file"),
        (["g23_id.sto"], "", "but no vertical force. Give the files that belong together"),
        (["g23_ik.mot"], "", "but no vertical force. Give the files that belong together"),
    ],
)
def test_strange_files_in_the_browser(world, monkeypatch, names, mass, shown):
    """From a file to columns and valid strides, or to what it lacks."""
    pytest.importorskip("ezc3d")
    monkeypatch.setattr(recordings, "close_old_connections", lambda: None)  # it is the test's
    client = client_of(world, Role.PT)
    endings = upload(client, [signals("lab_files") / name for name in names])
    page = client.post(reverse("check-recording"), {"ending": endings, "mass": mass})
    assert shown in page.content.decode()


@pytest.mark.django_db
def test_a_problem_names_the_file_as_its_owner_does(world, monkeypatch):
    wrong = "No column of {} is a vertical force."
    monkeypatch.setattr(
        "rehab.sessions.pages.recording.check_upload",
        lambda files, *_others: recordings.Checked(None, [wrong.format(files[0].name)]),
    )
    client = client_of(world, Role.PT)
    upload(client, [samples.FOLDER / "strides.csv"])
    answers = {"ending": ".csv", "mass": "", "files": "Monday walk.csv"}
    page = client.post(reverse("check-recording"), answers)
    assert page.context["problems"] == [wrong.format("Monday walk.csv")]


def test_an_upload_that_nobody_stores_is_removed_after_a_day():
    file = uploaded_file(7, ".csv")
    add_part(file, b"abc", 0)
    began = datetime.fromtimestamp(file.stat().st_mtime, UTC)
    discard_old_uploads(began + timedelta(hours=23))
    assert file.exists()
    discard_old_uploads(began + timedelta(hours=25))
    assert not file.exists()


def test_sizes_are_bounded(monkeypatch):
    monkeypatch.setattr(recordings, "UPLOAD_BYTES_MAX", 10)
    file = uploaded_file(7, ".csv")
    add_part(file, b"12345678", 0)
    with pytest.raises(UploadRefused):
        add_part(file, b"345", 8)
    with pytest.raises(UploadRefused):
        add_part(file, bytes(recordings.PART_BYTES + 1), 0)


@pytest.mark.parametrize("ending", ["", ".py", "/../../x.csv", ".csv/..", ".gz"])
def test_other_kinds_of_files(ending):
    with pytest.raises(UploadRefused):
        uploaded_file(7, ending)


def test_names_lead_nowhere_else():
    assert name_recording("../../etc/Passwd") == "etcpasswd.csv"
    assert name_recording("Walk 7, left!") == "walk-7-left.csv"
    assert name_recording("…/..") == ""


def test_columns_as_they_are_chosen():
    chosen = {
        "left.force": {"column": "F z", "factor": "-1", "delay_ms": ""},
        "left.angle": {"column": "", "factor": "2", "delay_ms": ""},
        "left.moment": {"column": "M", "factor": "0,001", "delay_ms": "12"},
    }
    assert write_columns(chosen, {"column": "t", "factor": ""}) == [
        "time=t*1",
        "left.force=F z*-1@0",
        "left.moment=M*0.001@0.012",
    ]
    with pytest.raises(ValueError, match="one"):
        write_columns(chosen, {"column": "t", "factor": "one"})


@pytest.mark.django_db
def test_one_file_is_checked_at_a_time_and_after_everything_else(monkeypatch):
    """So a person who sends many files takes no processor from a training."""
    began: list[list[str]] = []

    def run(arguments: list[str], **options: object) -> subprocess.CompletedProcess[str]:
        began.append(arguments)
        other = check_upload([uploaded_file(8, ".csv")], None)
        assert other.wrong == ["Other files are being checked. Try again in a minute."]
        return subprocess.CompletedProcess(arguments, 0, "{}", "")

    monkeypatch.setattr(recordings, "WAIT_S", 0.01)
    monkeypatch.setattr(subprocess, "run", run)
    for _again in range(2):
        assert check_upload([uploaded_file(7, ".csv")], None).found == {}
    assert len(began) == 2
    for arguments in began:
        assert "--bounded" in arguments
        assert (arguments[0] == "nice") == bool(shutil.which("nice"))


@pytest.mark.django_db(transaction=True)
def test_who_waits_for_a_check_holds_no_connection(monkeypatch):
    """A server has a handful of them for all its pages."""
    held: list[object] = []

    def run(arguments: list[str], **options: object) -> subprocess.CompletedProcess[str]:
        held.append(connection.connection)
        return subprocess.CompletedProcess(arguments, 0, "{}", "")

    connection.ensure_connection()
    monkeypatch.setattr(subprocess, "run", run)
    check_upload([uploaded_file(7, ".csv")], None)
    assert held == [None]


def test_the_parser_of_an_upload_has_no_key_and_may_use_little(tmp_path, monkeypatch):
    """Whatever a file makes of it: it is asked for its own variables and limits here."""
    monkeypatch.setenv("GARRY_SECRET_KEY", "a secret")
    monkeypatch.setenv("PGPASSWORD", "another")
    run = subprocess.run
    asked = (
        "import json, os, resource; "
        "from rehab.gait.recordings.resource_limits import limit_resources; "
        "limit_resources(); kinds = ('CPU', 'AS', 'FSIZE', 'NOFILE'); print(json.dumps({'names': "
        "sorted(os.environ), 'most': [resource.getrlimit(getattr(resource, f'RLIMIT_{kind}'))[0] "
        "for kind in kinds]}))"
    )

    def ask(arguments: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
        assert "--bounded" in arguments  # with which it limits itself
        return run([sys.executable, "-c", asked], **options)

    monkeypatch.setattr(subprocess, "run", ask)
    told = recordings.check_upload([tmp_path / "walk.csv"], None, None).found
    assert not {name for name in told["names"] if name.startswith(("GARRY_", "PG", "NOTIFY"))}
    assert "PATH" in told["names"]
    assert told["most"] == [60, 4 * 1024**3, 512 * 1024**2, 128]
