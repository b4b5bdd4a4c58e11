"""Static files are those of the static folders, and whatever else is asked for is not there."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest
from django.contrib.staticfiles import finders
from django.core.asgi import get_asgi_application
from django.core.files import File
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


def test_collected_files_are_those_that_one_machine_serves(tmp_path):
    storage = MinifiedStorage(location=tmp_path)
    for name in ["css/walk/walk.css", "uplot/uPlot.min.css", "admin/css/base.css"]:
        written = Path(finders.find(name)).read_bytes()
        with Path(finders.find(name)).open("rb") as file:
            storage.save(name, File(file))
        assert (tmp_path / name).read_bytes() == minify(name, written)
        assert (minify(name, written) == written) == (not name.startswith("css/"))
