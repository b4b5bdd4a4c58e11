"""`doctor` says what is well, and names a cure for what is not."""

from __future__ import annotations

import json
from io import StringIO

import pytest
from django.core.management import call_command

from rehab.people.audit import append_only_triggers
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import Step
from rehab.sessions.models import TrainingSession
from rehab.training.fold.checkpoints import fold_to_json
from tests.support.walks import walk
from tests.support.world import build_world, set_owner

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def well_set_up(settings, tmp_path):
    settings.DATA_DIR = tmp_path
    for name in settings.BROWSER_LIBRARIES:
        (tmp_path / name).mkdir()
    settings.BROWSER_LIBRARIES = {name: tmp_path / name for name in settings.BROWSER_LIBRARIES}


def ask(**options: bool) -> tuple[int, str]:
    out = StringIO()
    try:
        call_command("doctor", stdout=out, **options)
    except SystemExit as ended:
        return int(str(ended.code)), out.getvalue()
    return 0, out.getvalue()


def test_a_sound_installation_is_well():
    build_world("amber")
    status, said = ask()
    assert status == 0, said
    assert "1 valid, 1 never used" in said


def test_sessions_that_a_dead_process_left_are_named():
    world = build_world("amber")
    TrainingSession.everywhere.filter(pk=world.session.pk).update(state="running")
    set_owner(world.clinic.pk, "x|1|0")
    status, said = ask()
    assert status == 1
    assert f"1 left running by a process that is gone: {world.session.pk}" in said
    assert "Start the server" in said


def test_logs_are_looked_through_on_demand():
    world = build_world("amber")
    session = walk(world.patient, "binary", [4.0] * 4, end=None)
    fold = SessionAggregate.load(session).fold
    TrainingSession.everywhere.filter(pk=session.pk).update(checkpoint=fold_to_json(fold))
    assert "the same by checkpoint" in ask(deep=True)[1]
    fold.feedback.points = 99
    TrainingSession.everywhere.filter(pk=session.pk).update(checkpoint=fold_to_json(fold))
    status, said = ask(deep=True)
    assert status == 1
    assert f"session {session.pk} is another one by its checkpoint" in said
    TrainingSession.everywhere.filter(pk=session.pk).update(checkpoint=None)
    with append_only_triggers.lifted("default"):
        Step.everywhere.filter(session=session, number=2).delete()
    assert f"session {session.pk} lacks steps" in ask(deep=True)[1]


def test_a_failing_child_is_named_with_its_last_words(tmp_path):
    child = {"name": "robot", "state": "failed", "restarts": 4, "last_output": ["no port"]}
    (tmp_path / "children.json").write_text(json.dumps({"server": 1, "children": [child]}))
    status, said = ask()
    assert status == 1
    assert "robot: failed, restarted 4 times" in said
    assert "Its last words: no port" in said


def test_missing_files_are_named(settings, tmp_path):
    settings.BROWSER_LIBRARIES = {"uplot": tmp_path / "absent"}
    status, said = ask()
    assert status == 1
    assert "missing: uplot" in said
    assert "make setup" in said
