"""The insight page as a therapist uses it: compared, narrowed, read, and taken along as a file."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.support.browsers import Visit, picture
from tests.support.layout import set_screen, too_small
from tests.support.servers import Server

pytestmark = pytest.mark.browser

# Rosa and Omar walk at goals of 2, once a week; Omar falls in his last session. Lena's is left out.
SEED = """
import json
from django.utils import timezone
from rehab.people.models import User
from rehab.people.sign_in.first_start import first_clinic
from rehab.sessions.corrections import CorrectedField, add_note, correct_session
from rehab.sessions.log import Remark, SessionEvent
from tests.support.walks import make_patient, strides, walk
now, lead = timezone.now(), User.everywhere.get(username="pt")
def person(name, code):
    return make_patient(first_clinic(), name, code=code)
rosa, omar, lena = person("Rosa", "R-1"), person("Omar", "O-2"), person("Lena", "L-3")
for weeks, hits in ((2, 4), (1, 6)):
    walk(rosa, "positive", strides(hits, 10 - hits), days_ago=7 * weeks, now=now)
noted = walk(rosa, "binary", strides(8, 2), now=now)
add_note(noted, "Held on with the left hand.", lead, now)
walk(omar, "binary", strides(2, 8), days_ago=7, now=now)
fell = walk(omar, "binary", strides(4, 6), now=now)
for kind, value in ((Remark.FALL, None), (Remark.FALL_SEVERITY, 1)):
    SessionEvent.everywhere.create(
        session=fell, kind=kind, value=value, after_number=5, at=fell.began_at
    )
left_out = walk(lena, "positive", strides(10, 0), now=now)
correct_session(left_out, {CorrectedField.COUNTS: "no"}, "The sensor slipped.", lead, now)
walk(rosa, "explicit", strides(5, 5), days_ago=300, now=now)
print(json.dumps({"fell": fell.pk, "noted": noted.pk}))
"""


@pytest.fixture
def sessions(server: Server) -> dict[str, int]:
    stored: dict[str, int] = json.loads(server.run_shell(SEED))
    return stored


def rows(page: Page) -> dict[str, list[str]]:
    """Return the table's rows: how many sessions and patients, then its cells as text, by label."""
    found = {}
    for row in page.locator("tbody tr").all():
        named, size = (
            " ".join(row.locator(part).inner_text().split()) for part in ("th", "th small")
        )
        label = named.removesuffix(size).strip()
        cells = [" ".join(cell.inner_text().split()) for cell in row.locator("td").all()]
        found[label] = [*(each.split()[0] for each in size.split(", ")), *cells]
    return found


def test_sessions_are_compared_and_taken_along(visit: Visit, sessions: dict[str, int]) -> None:
    page = visit("/start/", size="laptop")
    page.click("text=Hit rates compared")

    # Weeks first, the newest on top; each of one or two patients, whose means have the interval.
    weeks = rows(page)
    assert [row[:2] for row in weeks.values()] == [["2", "2"], ["2", "2"], ["1", "1"]]
    newest = next(iter(weeks.values()))
    assert newest[2] == "60 %"  # too few for an interval
    assert "1 × fall" in newest[-1]

    # Feedback types and patients, one tap each; a session that was left out is in none.
    page.click("text=Feedback types")
    types = rows(page)
    assert {label: row[:2] for label, row in types.items()} == {
        "Binary": ["3", "2"],
        "Positive": ["2", "1"],
    }
    page.click(".chips >> text=Patients")
    assert set(rows(page)) == {"Omar (O-2)", "Rosa (R-1)"}
    assert rows(page)["Rosa (R-1)"][2].startswith("60 % (")
    assert page.locator("svg.interval rect").count() == 1  # none of fewer than three sessions
    page.click("summary:has-text('Filter')")
    page.click(".chips >> text=All time")
    page.click("text=Feedback types")
    assert "Explicit" in rows(page)

    # What went wrong leads to its moment, a note to its session.
    fell = page.locator(".events li", has_text="Omar: fall, slightly hurt")
    assert f"/sessions/{sessions['fell']}/replay/?at=" in str(
        fell.locator("a").get_attribute("href")
    )
    expect(page.locator(".events li", has_text="Held on with the left hand.")).to_be_visible()
    page.click(".events a:text-is('Session')")
    page.wait_for_url(f"**/sessions/{sessions['noted']}/details/")
    page.go_back()

    # One tap takes along what is shown.
    with page.expect_download() as download:
        page.click("text=Download")
    (head, *lines) = csv.reader(io.StringIO(Path(download.value.path()).read_text("utf-8-sig")))
    told = [dict(zip(head, line, strict=True)) for line in lines]
    assert len(told) == sum(int(row[0]) for row in rows(page).values()) == 6
    (fall,) = [line for line in told if line["fall"] == "1"]
    assert (fall["code"], fall["feedback_type"], float(fall["hit_rate"])) == ("O-2", "binary", 0.4)
    (note,) = [line["note"] for line in told if line["note"]]
    assert note.endswith("Held on with the left hand.")

    # The same on a phone and on a wall.
    for screen in ("phone", "wall"):
        set_screen(page, screen)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert too_small(page, ".insight .chips a, .insight .btn", 44) == []
        # What a narrow row has no room for opens below.
        more = page.get_by_text("Minutes, exertion, adverse events")
        expect(more).to_be_visible(visible=screen == "phone")
        if screen == "phone":
            expect(page.locator("tbody tr").first.locator("td:visible")).to_have_count(2)
            assert all(row.bounding_box()["height"] < 140 for row in page.locator("tbody tr").all())
        picture(page, f"insight-{screen}")
