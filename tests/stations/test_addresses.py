"""The address that the page of pairing tells is one that a tablet reaches."""

from __future__ import annotations

import pytest
from django.urls import reverse

from rehab.stations.pages.pairing import reachable_host
from tests.support.world import World


@pytest.mark.parametrize(
    ("opened", "names", "told"),
    [
        ("192.168.1.20:8000", ["192.168.1.20"], "192.168.1.20:8000"),
        ("garry.clinic.example", [], "garry.clinic.example"),
        ("127.0.0.1:8000", ["::", "localhost", "192.168.1.20"], "192.168.1.20:8000"),
        ("localhost", ["127.0.0.1", "gym-server"], "gym-server"),
        ("[::1]:8000", ["::", "*", ".clinic.example", "[fd00::20]"], "[fd00::20]:8000"),
        ("127.0.0.1:8000", ["127.0.0.1", "localhost", "[::1]", "*"], None),
    ],
)
def test_a_tablet_reaches_what_it_is_told(opened: str, names: list[str], told: str | None) -> None:
    assert reachable_host(opened, names) == told


@pytest.mark.django_db
def test_the_page_says_where_or_what_to_do(world: World, settings: object) -> None:
    client = world.pt
    settings.HOST, settings.ALLOWED_HOSTS = "127.0.0.1", ["127.0.0.1"]  # type: ignore[attr-defined]
    page = client.get(reverse("pair"), headers={"host": "127.0.0.1:8000"}).content.decode()
    assert 'action="/https/?next=%2Ftablets%2Fpair%2F"' in page
    settings.ALLOWED_HOSTS = ["127.0.0.1", "192.168.1.20"]  # type: ignore[attr-defined]
    page = client.get(reverse("pair"), headers={"host": "127.0.0.1:8000"}).content.decode()
    assert "http://192.168.1.20:8000/tablet/" in page
    assert "/https/" not in page
