"""What a server does by itself each night, and what monitoring learns of it."""

from __future__ import annotations

import ssl
from datetime import timedelta
from io import StringIO
from pathlib import Path

import pytest
from django.core.management import call_command
from django.utils import timezone

from rehab.exports.encryption import generate_key
from rehab.management.commands import upkeep
from rehab.people.audit.seals import seal_at_once
from rehab.people.server_keys import Purpose, store_first
from rehab.people.upkeep_runs import Chore, record_chore
from rehab.sessions.seals import seal_sessions
from rehab.stations.https.authority import OwnAuthority
from tests.support.walks import HIT, MISS, walk

pytestmark = pytest.mark.django_db
SECRET, PUBLIC = generate_key()


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, settings) -> Path:
    backups = tmp_path / "backups"
    backups.mkdir()
    (tmp_path / "key.txt").write_text(SECRET)
    settings.BACKUP_DIR = str(backups)
    settings.BACKUP_KEYS = [PUBLIC]
    settings.RESTORE_KEY = str(tmp_path / "key.txt")
    settings.SHIPPED_LOGS = str(tmp_path / "logs")
    settings.DATA_DIR = tmp_path
    return backups


def do(*what: str) -> str:
    """Do chores; return what they say."""
    out = StringIO()
    try:
        call_command("upkeep", *what, stdout=out, stderr=out)
    except SystemExit as end:
        assert end.code == 1
        out.write("FAILED")
    return out.getvalue()


def test_a_chore_that_fails_keeps_no_other_from_being_done(settings, world):
    settings.BACKUP_DIR = ""
    told = do("backup", "seals", "keys")
    assert "backup: GARRY_BACKUP_DIR is not set" in told
    assert told.endswith("FAILED")
    assert {one.name: one.is_well for one in Chore.objects.all()} == {
        "backup": False,
        "seals": True,
        "keys": True,
    }


def test_backups_past_their_time_go_once_a_new_one_is_there(folder, settings, world):
    now = timezone.now()
    for days in (1, 29, 30, 31, 400):
        (folder / f"garry-{now - timedelta(days=days):%Y-%m-%d}.backup").touch()
    (folder / "before.backup").touch()  # an upgrade's
    settings.BACKUP_KEYS = []
    assert "FAILED" in do("backup")
    assert len(list(folder.iterdir())) == 6
    settings.BACKUP_KEYS = [PUBLIC]
    do("backup")
    kept = {
        (now - timedelta(days=days)).strftime("garry-%Y-%m-%d.backup") for days in (0, 1, 29, 30)
    }
    assert {file.name for file in folder.iterdir()} == kept | {"before.backup"}


@pytest.mark.long
@pytest.mark.server
@pytest.mark.django_db(transaction=True)
@pytest.mark.postgres
def test_the_weekly_restore_is_red_where_a_backup_is_damaged(folder, world):
    walk(world.patient, "positive", [HIT, MISS] * 20)
    for clinic in (world.clinic.pk, None):  # as the server does: the scratch one has a real clock
        seal_at_once(clinic, timezone.now())
    seal_sessions(timezone.now())
    do("backup")
    told = do("weekly")
    assert "steps are restored" in told
    assert "FAILED" not in told
    assert not list(folder.parent.glob("restore-*"))  # the scratch database is gone
    (file,) = folder.glob("*.backup")
    whole = file.read_bytes()
    file.write_bytes(whole[:3000] + bytes([whole[3000] ^ 1]) + whole[3001:])
    assert "damaged or was cut off" in do("weekly")
    assert not Chore.objects.get(name="restore").is_well
    assert not list(folder.parent.glob("restore-*"))


@pytest.mark.server
@pytest.mark.long
@pytest.mark.django_db(transaction=True)
def test_a_backup_whose_keys_nothing_opens_is_red(folder, world, monkeypatch):
    do("keys")
    store_first(Purpose.STUDIES)
    monkeypatch.setattr("rehab.management.commands.backup.close_keys_again", lambda _keys: [])
    do("backup")
    assert "studies 1: not opened" in do("restore")


def test_a_certificate_that_ends_soon_is_told_before(settings, tmp_path, monkeypatch):
    own = OwnAuthority(tmp_path)
    own.make(["garry.example.org"], timezone.now())
    shown = own.server.read_text().partition("-----BEGIN EC")[0].partition("-----BEGIN PRIV")[0]
    asked: list[tuple[str, int]] = []

    def show(where: tuple[str, int], timeout: float) -> str:
        asked.append(where)
        return shown

    monkeypatch.setattr(ssl, "get_server_certificate", show)
    settings.ALLOWED_HOSTS = [".garry.example.org"]
    assert "valid until" in do("certificate")
    monkeypatch.setattr(upkeep, "RENEWED", timedelta(days=10_000))
    assert "Run certbot renew" in do("certificate")
    assert asked[0] == ("garry.example.org", 443)


def test_logs_are_shipped_and_seals_compared(settings, world):
    assert "new seals" in do("hourly")
    assert Path(settings.SHIPPED_LOGS).read_text()
    assert "seals hold" in do("seals")


def test_monitoring_reads_how_chores_went(client, settings):
    settings.METRICS_TOKEN = "m" * 20
    now = timezone.now()
    record_chore("backup", "", now, failed=False)
    record_chore("restore", "It is damaged.", now, failed=True)
    shown = client.get("/metrics", headers={"Authorization": "Bearer " + "m" * 20}).content.decode()
    assert 'garry_chore_well{chore="backup"} 1.0' in shown
    assert 'garry_chore_well{chore="restore"} 0.0' in shown
    assert f'timestamp_seconds{{chore="backup"}} {now.timestamp():.6e}'[:-6] in shown
    assert 'timestamp_seconds{chore="restore"} 0.0' in shown
    assert "garry_disk_free_ratio 0." in shown
