"""Static files are those of the static folders, and whatever else is asked for is not there."""

from __future__ import annotations

import pytest
from django.core.asgi import get_asgi_application
from django.test import RequestFactory

from rehab.people.web.static_files import StaticFilesHandler


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
    handler = StaticFilesHandler(get_asgi_application())
    answer = handler.get_response(RequestFactory().get("/", PATH_INFO=path))
    assert answer.status_code == status
    assert answer["X-Content-Type-Options"] == "nosniff"
    policy = answer["Content-Security-Policy"].split(";")
    assert "script-src 'self'" in {directive.strip() for directive in policy}
    answer.close()
