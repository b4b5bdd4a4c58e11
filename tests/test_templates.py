"""A migrated database is kept for later runs, and made anew when the product's code has changed."""

from pathlib import Path

import pytest

from tests.support import templates


@pytest.fixture
def code(tmp_path, monkeypatch):
    for name in ("constraints.txt", "garry_site/settings.py", "rehab/migrations/0001.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("as it was")
    monkeypatch.setattr(templates, "ROOT", tmp_path)
    monkeypatch.setattr(templates, "FOLDER", tmp_path / "kept")
    templates._digest.cache_clear()
    yield tmp_path
    templates._digest.cache_clear()


def test_it_is_kept_by_its_name(code):
    assert templates.read("server") is None
    templates.keep("server", b"tables")
    templates.keep("another", b"other tables")
    assert templates.read("server") == b"tables"


@pytest.mark.parametrize("file", ["constraints.txt", "rehab/migrations/0002.py"])
def test_other_code_makes_it_anew(code, file):
    templates.keep("server", b"tables")
    (code / file).write_text("as it is")
    templates._digest.cache_clear()
    assert templates.read("server") is None
    templates.keep("server", b"new tables")
    assert [kept.read_bytes() for kept in templates.FOLDER.iterdir()] == [b"new tables"]


def test_it_never_goes_while_another_worker_reads_it(code, monkeypatch):
    templates.keep("server", b"tables")
    monkeypatch.delattr(Path, "unlink")
    templates.keep("server", b"the same tables")
    assert templates.read("server") == b"the same tables"
