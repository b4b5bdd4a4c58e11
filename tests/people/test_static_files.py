"""Static files are those of the static folders, and whatever else is asked for is not there."""

from __future__ import annotations

import re
from contextlib import closing
from pathlib import Path

import pytest
from django.contrib.staticfiles import finders
from django.core.asgi import get_asgi_application
from django.test import RequestFactory

from rehab.people.web.static_files import MinifiedStorage, StaticFilesHandler, minify


def get(path: str):
    return StaticFilesHandler(get_asgi_application()).get_response(
        RequestFactory().get("/", PATH_INFO=path)
    )


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/static/img/mark.svg", 200),
        ("/static/no/such.file", 404),
        ("/static/../../../../etc/passwd", 404),
        ("/static/..", 404),
        ("/static//etc/passwd", 404),
        ("/static/img/../../garry_site/settings.py", 404),
        ("/static/img/mark.svg\x00.txt", 404),
        ("/static/" + "a" * 5000, 404),
        ("/static/img", 404),
    ],
)
@pytest.mark.django_db
def test_no_path_leads_out_of_the_static_folders(path, status):
    answer = get(path)
    assert answer.status_code == status
    assert answer["X-Content-Type-Options"] == "nosniff"
    policy = answer["Content-Security-Policy"].split(";")
    assert "script-src 'self'" in {directive.strip() for directive in policy}
    answer.close()


@pytest.mark.parametrize("name", ["css/walk/walk.css", "js/walk/walk.js"])
@pytest.mark.django_db
def test_our_files_are_served_without_comments(name, settings):
    written = Path(finders.find(name)).read_bytes()
    assert b"/*" in written or b"//" in written
    with closing(get(f"/static/{name}")) as answer:
        sent = answer.getvalue()
    assert b"/*" not in sent
    assert b"// " not in sent
    assert len(sent) < 0.9 * len(written)
    assert answer["Content-Length"] == str(len(sent))
    assert answer["Last-Modified"]
    settings.DEBUG = True
    with closing(get(f"/static/{name}")) as answer:
        assert answer.getvalue() == written


@pytest.mark.parametrize("name", ["css/walk/walk.css", "js/walk/total.js", "admin/css/base.css"])
def test_a_hosted_server_gets_them_minified_too(tmp_path, name):
    storage = MinifiedStorage(location=tmp_path)
    written = Path(finders.find(name)).read_bytes()
    names = set()
    for _ in range(2):  # gathered again, by the next release
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        if not (tmp_path / name).exists():  # as Django does, where nothing is newer
            (tmp_path / name).write_bytes(written)
        assert all(done for *_, done in storage.post_process({name: (None, name)}))
        names.add(storage.stored_name(name))
    (hashed,) = (tmp_path / one for one in names)
    assert hashed.name != Path(name).name
    assert hashed.read_bytes() == minify(name, written)
    assert (minify(name, written) == written) == name.startswith("admin/")


def test_style_sheets_lose_comments_and_indents_alone():
    sheets = list(Path("static/css").rglob("*.css"))
    assert len(sheets) > 40
    for sheet in sheets:
        written = sheet.read_text()
        assert not re.search(r"""["'][^"'\n]*/\*""", written), f"{sheet}: a comment in a text"
        lines = re.sub(r"/\*[\s\S]*?\*/", "", written).splitlines()
        kept = minify(f"css/{sheet.name}", sheet.read_bytes()).decode().splitlines()
        kept, lines = ([line.strip() for line in some if line.strip()] for some in (kept, lines))
        assert kept == lines
